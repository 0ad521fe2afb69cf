# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders exported stages, in the Python that has primray: Blender has a USD and a Python of its own.

Reads requests, lines of JSON, and writes lines of JSON: progress, pictures so far, and the end. Pixels go into a file that both
processes map: float32 RGBA, the bottom row first, as Blender's passes are. The end of stdin ends the process.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import traceback
import warnings
from typing import Any

import numpy as np

# Relative standard errors and their colours in the overlay, linear.
ERROR_COLORS = (
    (0.003, (0.0, 0.0, 1.0)),
    (0.01, (0.0, 0.6, 0.8)),
    (0.03, (0.0, 0.7, 0.0)),
    (0.1, (1.0, 0.8, 0.0)),
    (0.3, (1.0, 0.0, 0.0)),
)
MOST_RANKS = 16
ERROR_WINDOW = 7  # pixels: an error by itself has one degree of freedom


def say(**values: Any) -> None:
    print(json.dumps(values), flush=True)


class Pixels:
    """The mapped file that pictures are handed over in."""

    def __init__(self, path: str) -> None:
        self.path = path

    def put(self, planes: dict[str, np.ndarray]) -> dict[str, list[int]]:
        """Write the planes one after the other. Returns the offset in floats, rows, columns and channels of each."""
        places, at = {}, 0
        temporary = f"{self.path}.next"
        with open(temporary, "wb") as file:
            for name, plane in planes.items():
                upside = np.ascontiguousarray(plane[::-1], np.float32)
                file.write(upside.data)
                places[name] = [at, *upside.shape]
                at += upside.size
        os.replace(temporary, self.path)
        return places


def main() -> None:
    stopping = threading.Event()
    requests: list[dict[str, Any]] = []
    arrived = threading.Condition()

    def listen() -> None:
        for line in sys.stdin:
            request = json.loads(line)
            if request.get("stop"):
                stopping.set()
                continue
            with arrived:
                requests.append(request)
                arrived.notify()
        os._exit(0)  # whoever asked is gone

    threading.Thread(target=listen, daemon=True).start()
    import primray

    say(ready=primray.__version__)
    while True:
        with arrived:
            arrived.wait_for(lambda: bool(requests))
            request = requests.pop(0)
        stopping.clear()
        try:
            _render(request, stopping)
        except primray.errors.RenderCancelled:
            say(cancelled=True)
        except primray.PrimrayError as error:
            say(error=str(error))
        except Exception as error:
            traceback.print_exc()
            say(error=f"{type(error).__name__}: {error}")


def _render(request: dict[str, Any], stopping: threading.Event) -> None:
    import primray
    from primray.render.progress import Snapshots

    pixels = Pixels(request["pixels"])
    opaque = not request.get("transparent")

    def progress(fraction: float, samples: int, rays: int) -> bool:
        say(progress=fraction)
        return not stopping.is_set()

    def take(image: Any) -> None:
        say(picture=pixels.put({"Combined": _combined(image.pixels, opaque)}))

    values = {name: request[name] for name in ("seed", "threads", "time_code") if request.get(name) is not None}
    wanted = request.get("passes", [])
    aovs = list({_aov(asked["source"]) for asked in wanted} - {""})
    if any(asked["source"] == "denoised" for asked in wanted):
        values["denoise"] = True
    scene = primray.Scene(request["stage"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        image = scene.render(
            aovs=aovs, dome_visible=opaque, progress=progress, snapshots=Snapshots(request.get("every_s", 1.0), take), **values
        )
    header: dict[str, str] = {}
    planes = {"Combined": _combined(image.pixels, opaque)} | _planes(image, request, opaque, header)
    report = image.report
    told = [{"code": row["code"], "prim": row["prim_path"], "message": row["message"]} for row in report["diagnostics"]
            if row["severity"] != "info"]  # fmt: skip
    say(
        done=pixels.put(planes), diagnostics=told, sha256=report.get("pixels_sha256"), relmse=_relmse(report), header=header,
        stop=report["stop"]["reason"], samples=report["samples_per_pixel"],
    )  # fmt: skip
    scene.close()


def _aov(source: str) -> str:
    """Return the AOV of primray that a pass is made from, or "": assets are named after objects."""
    if source == "crypto_asset":
        return "crypto_object"
    return "" if source in ("denoised", "error", "error_overlay") else source


def _planes(image: Any, request: dict[str, Any], opaque: bool, header: dict[str, str]) -> dict[str, np.ndarray]:
    """Return the passes beside Combined; adds the names of Cryptomattes to `header`."""
    planes: dict[str, np.ndarray] = {}
    mattes: dict[str, np.ndarray] = {}
    for asked in request.get("passes", []):
        name, source = asked["name"], asked["source"]
        if source.startswith("crypto_"):
            if source not in mattes:
                kind = name.rstrip("0123456789")
                mattes[source], manifest = _cryptomatte(image.aovs[_aov(source)], request["names"], source)
                header |= _header(f"{request['layer']}.{kind}", manifest)
            planes[name] = mattes[source][:, :, 4 * asked["rank"] : 4 * asked["rank"] + 4]
        elif source == "denoised":
            if image.denoised is not None:
                planes[name] = _combined(image.denoised.pixels, opaque)
        elif source == "error":
            planes[name] = image.errors.mean(axis=2, keepdims=True)
        elif source == "error_overlay":
            planes[name] = _error_overlay(image)
        elif source in image.aovs:
            planes[name] = _plain(image.aovs[source].values)
    return planes


def _cryptomatte(aov: Any, names: dict[str, dict[str, str]], source: str) -> tuple[np.ndarray, dict[str, int]]:
    """Return a Cryptomatte (H, W, 4 * layers) whose ids are those of Blender's names, and these with their ids.

    What has one name in Blender, such as instances of an object, is one there.
    """
    from primray.images.cryptomatte import hash_of

    (told,) = [json.loads(value) for key, value in aov.metadata.items() if key.endswith("/manifest")]
    renamed = {int(number, 16): _blender_name(name, names, source) for name, number in told.items()}
    height, width, channels = aov.values.shape
    pairs = np.ascontiguousarray(aov.values).reshape(height * width, channels // 2, 2)
    at, rank = np.nonzero(pairs[..., 1] > 0)
    ids, weights = pairs[at, rank, 0].view(np.uint32), pairs[at, rank, 1].astype(np.float64)
    different, index = np.unique(ids, return_inverse=True)
    hashes = np.array([hash_of(renamed[n]) if n in renamed else n for n in different.tolist()] or [0], np.uint64)
    # Add up what has the same name, and order by coverage.
    keys, place = np.unique(np.asarray(at, np.uint64) << np.uint64(32) | hashes[index], return_inverse=True)
    sums = np.bincount(place, weights=weights, minlength=len(keys))
    at, ids = (keys >> np.uint64(32)).astype(np.int64), (keys & np.uint64(0xFFFFFFFF)).astype(np.uint32)
    order = np.lexsort((ids, -sums, at))
    at, ids, sums = at[order], ids[order], sums[order]
    rank = np.arange(len(at)) - np.searchsorted(at, at)
    found = np.zeros((height * width, MOST_RANKS, 2), np.float32)
    kept = rank < MOST_RANKS
    found[at[kept], rank[kept], 0] = ids[kept].view(np.float32)
    found[at[kept], rank[kept], 1] = sums[kept]
    return found.reshape(height, width, 2 * MOST_RANKS), {name: hash_of(name) for name in sorted(set(renamed.values()))}


def _blender_name(name: str, names: dict[str, dict[str, str]], source: str) -> str:
    """Return Blender's name for one of primray's: of a material, or of the object that a prim was exported from."""
    if source == "crypto_material":
        return names["materials"].get(name, name)
    path = name.rpartition("|")[2]  # an instance has the name of what it is an instance of
    while path and path not in names["objects"]:
        path = path.rpartition("/")[0]
    found = names["objects"].get(path, name)
    return names["assets"].get(found, found) if source == "crypto_asset" else found


def _header(layer: str, manifest: dict[str, int]) -> dict[str, str]:
    from primray.images.cryptomatte import header_of

    return header_of(layer, manifest)


def _error_overlay(image: Any) -> np.ndarray:
    """Return the picture in the colours of its relative standard error, as relMSE counts it, over windows of pixels."""
    variance = _window(np.where(np.isfinite(image.errors), image.errors, 1e10).astype(np.float64) ** 2)
    size = _window(image.pixels[..., :3].astype(np.float64) ** 2 + 0.01)
    relative = np.sqrt(variance / size)
    at = np.log([error for error, _ in ERROR_COLORS])
    colors = np.array([color for _, color in ERROR_COLORS])
    logs = np.log(np.maximum(relative, 1e-9))
    overlay = np.stack([np.interp(logs, at, colors[:, c]) for c in range(3)], axis=2)
    grey = np.maximum(image.pixels[..., :3].mean(axis=2), 0)
    shade = 0.25 + 0.75 * grey / (grey + max(float(grey.mean()), 1e-9))
    return np.concatenate([overlay * shade[..., None], np.ones_like(grey)[..., None]], axis=2).astype(np.float32)


def _window(values: np.ndarray) -> np.ndarray:
    """Return the mean over the colours and over the square of pixels around each."""
    half = ERROR_WINDOW // 2
    padded = np.pad(values.mean(axis=2), half, mode="edge")
    sums = np.cumsum(np.cumsum(np.pad(padded, ((1, 0), (1, 0))), axis=0), axis=1)
    size = ERROR_WINDOW
    return (sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size]) / size**2


def _relmse(report: dict[str, Any]) -> float | None:
    found = (report.get("error") or {}).get("relmse")
    return found.get("estimate") if isinstance(found, dict) else None


def _combined(pixels: np.ndarray, opaque: bool) -> np.ndarray:
    """Return RGBA; a visible world covers, as in Blender."""
    if not opaque:
        return pixels
    covered = pixels.copy()
    covered[..., 3] = 1
    return covered


def _plain(values: np.ndarray) -> np.ndarray:
    """Return an AOV with a large number where it is infinite: Blender's passes have 1e10 where nothing is."""
    return np.where(np.isfinite(values), values, np.float32(1e10))


if __name__ == "__main__":
    main()
