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

# Passes by their names in Blender: the AOV and its number of channels.
AOVS = {"Depth": ("depth", 1), "Normal": ("normal", 3), "Denoised": ("", 4)}


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

    values = {name: request[name] for name in ("seed", "threads") if request.get(name) is not None}
    wanted = request.get("passes", [])
    aovs = [AOVS[name][0] for name in wanted if AOVS.get(name, ("",))[0]]
    if "Denoised" in wanted:
        values["denoise"] = True
    scene = primray.Scene(request["stage"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        image = scene.render(
            aovs=aovs, dome_visible=opaque, progress=progress, snapshots=Snapshots(request.get("every_s", 1.0), take), **values
        )
    planes = {"Combined": _combined(image.pixels, opaque)}
    for name in wanted:
        if name == "Denoised" and image.denoised is not None:
            planes[name] = _combined(image.denoised.pixels, opaque)
        elif AOVS.get(name, ("",))[0] in image.aovs and AOVS[name][0]:
            planes[name] = _plain(image.aovs[AOVS[name][0]].values)
    if "Error" in wanted:
        planes["Error"] = image.errors.mean(axis=2, keepdims=True)
    report = image.report
    told = [{"code": row["code"], "prim": row["prim_path"], "message": row["message"]} for row in report["diagnostics"]
            if row["severity"] != "info"]  # fmt: skip
    say(done=pixels.put(planes), diagnostics=told, sha256=report.get("pixels_sha256"), relmse=_relmse(report))
    scene.close()


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
