"""Views of a kept stage for agents: pictures of bounded size, what is seen in them by prim, and what an edit changed."""

from __future__ import annotations

import base64
import math
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from primray import usd
from primray.camera import Camera, Projection
from primray.compare import compare
from primray.compare.comparison import Comparison, Verdict
from primray.errors import PrimrayError, SettingsError
from primray.images.image import Image
from primray.images.writers import write_view
from primray.incremental.scene import KeptStage
from primray.settings import RenderSettings

PICTURE_BYTES = 250_000
RESULT_BYTES = 600_000  # of all pictures of an answer: base64 of them stays below the 2^20 characters that clients accept
QUALITIES = (92, 85, 75, 60, 45, 30)
MOST_ROWS = 30
SURE_Z = 5.0  # standard errors of a prim's mean difference: a false alarm in 1,000 comparisons of 500 prims
FEWEST_PIXELS = 16  # of a prim, whose spread says how uncertain its mean is
BACKGROUND = "(background)"
KEPT_LOOKS = 6  # that an edit can be compared with
KEPT_VIEWS = 64  # whose camera, size and samples are known for the next look
RESERVED_S = 0.12  # of a look's time, for what is not sampling: AOVs and encoding
LEAST_S = 0.02
# Shares of a look's time between which the settings of the last look at the view are kept: then nothing is built again, and the
# picture of an unchanged stage has the same bits.
SPENT = (0.7, 1.25)
DENOISE_S = 4e-6  # a pixel, until one is known: 2 cores
FEWEST, MOST_SPP = 2, 4096  # samples per pixel of a look
PILOT_SPP, PILOT_S = (2, 8, 32), 0.02
PILOT_SIDE, SMALLEST_SIDE = 96, 160  # pixels across: of what the speed is measured on, and of the least look
# Directions to the camera from the middle of the scene: degrees from the front to the right, and above the horizon.
DIRECTIONS = {
    "front": (0.0, 0.0),
    "right": (90.0, 0.0),
    "back": (180.0, 0.0),
    "left": (270.0, 0.0),
    "top": (0.0, 89.0),
    "bottom": (0.0, -89.0),
    "three-quarter": (35.0, 25.0),
}
FRAMING = "three-quarter"  # the direction from which the default view shows a prim that fills the picture
WINDOW = (-0.36, 0.36, -0.2025, 0.2025)  # at unit distance: 50 mm on 36 mm, 16:9
FAR = 1e30
MARGIN = 0.12  # room around what is framed, as a share of it
K = TypeVar("K")
V = TypeVar("V")


@dataclass(frozen=True, eq=False)
class Look:
    """A picture that was shown, and how to render it again."""

    view: str
    settings: RenderSettings
    image: Image


class Eye:
    """The looks of one kept stage."""

    def __init__(self, kept: KeptStage) -> None:
        self.kept = kept
        self.seen: dict[tuple[object, ...], Look] = {}  # by what was asked
        self._rate = 0.0  # samples a second, of the last picture; 0: unknown
        self._cameras: dict[tuple[object, ...], tuple[str | Camera | None, tuple[int, int]]] = {}  # of views of this stage
        self._chosen: dict[tuple[object, ...], RenderSettings] = {}  # of the last picture of each view
        self._denoise_s = DENOISE_S  # a pixel, of the last picture that was denoised

    def look(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Render the views that are asked for within the time, and return pictures and tables."""
        begun = time.monotonic()
        views = list(asked["views"])
        budget = max(asked["seconds"] - RESERVED_S, LEAST_S * len(views))
        rows = []
        images = []
        for number, view in enumerate(views):
            left = begun + budget - time.monotonic()
            look = self._rendered(asked, view, max(left / (len(views) - number), LEAST_S))
            images.append(look.image)
            rows.append({**_facts(view, look.image), **_seen(look.image, asked["taxonomy"])})
        pictures = pictures_of({view: shown(image) for view, image in zip(views, images, strict=True)})
        return {"answer": {"views": rows, "diagnostics": _noted(images[0])}, "pictures": pictures}

    def changed(self, asked: Mapping[str, Any], before: Eye | None) -> dict[str, Any]:
        """Compare a view with another stage's, or with what `look` showed of it before the stage's files changed.

        Both have the same samples, so that pixels that the change does not reach have the same bits.
        """
        view = asked["views"][0]
        if before is None:
            old = self.seen.get(_key(asked, view))
            if old is None:
                raise SettingsError(
                    "this view has not been looked at before: call look with the same views, size and time before the edit, "
                    "or give the other stage as before",
                    where="before",
                    code="no-look-before",
                )
        else:
            old = before._rendered(asked, view, asked["seconds"] / 2)
        settings = old.settings
        if asked["follow_camera"]:
            settings = replace(settings, camera=self._camera(asked, view)[0])
        new = Look(view, settings, self._render(settings))
        result = compare(old.image, new.image, tolerance=asked["tolerance"])
        assert isinstance(result, Comparison)
        _remember(self.seen, _key(asked, view), new, KEPT_LOOKS)
        changes = _changes(old.image, new.image, result)
        mask, more = changes.mask, len(changes.rows) - MOST_ROWS
        verdict = Verdict.CHANGED if changes.rows else result.verdict
        answer = {
            "verdict": verdict.value,
            "identical": result.identical,
            "mean_change_percent": _percent(result.relative),
            "mean_change_error_percent": _percent(result.relative_error),
            "changed_pixels_percent": round(100 * float(mask.mean()), 3),
            "box": _box(mask),
            "samples_per_pixel": settings.spp,
            "prims": changes.rows[:MOST_ROWS],
            "more": f"{more} more" if more > 0 else "",
            "notes": list(result.notes),
        }
        if verdict is Verdict.UNDECIDED:
            answer["advice"] = "noise may hide a difference of the tolerance: give more seconds, or a larger tolerance"
        old_image = replace(old.image, denoised=None)  # as the other is
        found = {"before": shown(old_image), "after": shown(new.image), "changes": _marked(shown(new.image), mask)}
        return {"answer": answer, "pictures": pictures_of(found)}

    def picture(self, asked: Mapping[str, Any], file: Path) -> dict[str, Any]:
        """Render to an EXR, to an error or for a time, and return a small picture of it as well."""
        camera, where = self._camera(asked, asked["views"][0])
        settings = RenderSettings(
            camera=camera,
            resolution=where,
            time_code=asked["time_code"],
            time_limit_s=asked["seconds"],
            target_error=asked["target_error"],
            variants=tuple(asked["variants"]),
            aovs=(),
        )
        image = self._render(settings)
        image.save(file)
        write_view(shown(image), str(file.with_suffix(".png")))
        row = _facts(asked["views"][0], image)
        small = _smaller(shown(image), 768)
        return {"answer": {**row, "diagnostics": _noted(image)}, "pictures": pictures_of({"render": small})}

    def _rendered(self, asked: Mapping[str, Any], view: str, seconds: float) -> Look:
        """Render a view with as many samples as the time is enough for; where that is less than FEWEST, at a smaller size.

        A time limit would leave pixels without samples, and another number of them in each render.
        """
        begun = time.monotonic()
        key = _key(asked, view)
        camera, size = self._cameras.get(key) or self._camera(asked, view)
        _remember(self._cameras, key, (camera, size), KEPT_VIEWS)
        settings = RenderSettings(
            camera=camera,
            resolution=size,
            time_code=asked["time_code"],
            spp=FEWEST,
            adaptive=False,
            denoise=False,
            variants=tuple(asked["variants"]),
            aovs=("prim", "instance", "distance", f"labels:{asked['taxonomy']}"),
        )
        for spp in PILOT_SPP if not self._rate else ():  # until it takes long enough to tell the speed
            pilot = self._render(replace(settings, resolution=_within(size, PILOT_SIDE), spp=spp, aovs=()))
            if pilot.report["sampling_s"] > PILOT_S:
                break
        denoise = bool(asked.get("denoise"))
        left_s = max(seconds - (time.monotonic() - begun), LEAST_S)
        before = self._chosen.get((key, denoise))
        if before is not None and SPENT[0] * left_s <= self._needs_s(before, denoise) <= SPENT[1] * left_s:
            settings = before
        else:
            settings = self._fitting(settings, size, left_s, denoise)
        _remember(self._chosen, (key, denoise), settings, KEPT_VIEWS)
        look = Look(view, settings, self._render(replace(settings, denoise=denoise)))
        _remember(self.seen, key, look, KEPT_LOOKS)
        return look

    def _needs_s(self, settings: RenderSettings, denoise: bool) -> float:
        """Return the seconds that a picture's samples, and its denoiser, are expected to take."""
        width, height = settings.resolution or (0, 0)
        return float(width * height * ((settings.spp or 0) / self._rate + denoise * self._denoise_s))

    def _fitting(self, settings: RenderSettings, size: tuple[int, int], seconds: float, denoise: bool) -> RenderSettings:
        """Return the settings with as many samples, and if need be of as small a size, as the seconds are enough for."""
        a_pixel_s = seconds / (size[0] * size[1])
        least_s = FEWEST / self._rate + denoise * self._denoise_s
        if a_pixel_s < least_s:
            side = max(round(max(size) * math.sqrt(a_pixel_s / least_s)), SMALLEST_SIDE)
            return replace(settings, resolution=_within(size, side))
        most = (a_pixel_s - denoise * self._denoise_s) * self._rate
        return replace(settings, spp=min(max(int(most) // 2 * 2, FEWEST), MOST_SPP))

    def _render(self, settings: RenderSettings) -> Image:
        image = self.kept.render(settings, None, "raise", None, (), lambda diagnostics: None)
        self._rate = image.report["samples"] / max(image.report["sampling_s"], 1e-3)
        if (denoise_s := image.report["stages_s"].get("denoise")) is not None:
            self._denoise_s = denoise_s / (image.resolution[0] * image.resolution[1])
        return image

    def _camera(self, asked: Mapping[str, Any], view: str) -> tuple[str | Camera | None, tuple[int, int]]:
        """Return the camera of a view's name, and the picture's size."""
        side, frame = asked["size"], asked["frame"]
        direction = direction_of(FRAMING if view == "default" and frame is not None else view)
        if direction is None and frame is not None:
            sentence = (
                f"a camera's own view frames no prim: leave frame out, or look from a direction ({', '.join(DIRECTIONS)})"
            )
            raise SettingsError(sentence, where="frame", code="view")
        if direction is None:
            camera = None if view == "default" else view
            plain = RenderSettings(
                camera=camera, resolution=(side, 0), time_code=asked["time_code"], variants=tuple(asked["variants"]), aovs=()
            )
            try:
                width, height = self.kept.translated(plain).resolution
            except SettingsError as error:
                if error.code != "unknown-camera":
                    raise
                sentence = f"{error.message}; other views: default, {', '.join(DIRECTIONS)}, AZIMUTH,ELEVATION"
                raise SettingsError(sentence, where=error.where, code=error.code) from None
            return camera, (side, height) if height <= side else (max(round(side * width / height), 1), side)
        plain = RenderSettings(time_code=asked["time_code"])  # checks itself
        stage = self.kept.opened.stage
        box = usd.world_box(stage, frame or "/", plain.time_code)
        if box is None:
            raise SettingsError("there is nothing with a size to look at", where=frame or "/", code="nothing-to-frame")
        is_z_up = usd.stage_facts(stage)["up_axis"] == "Z"
        return _looking_at(box, is_z_up, *direction), (side, max(round(side * 9 / 16), 1))


def _remember(kept: dict[K, V], key: K, value: V, most: int) -> None:
    """Keep a value as the newest of at most `most`; the oldest makes room for it."""
    kept.pop(key, None)
    kept[key] = value
    while len(kept) > most:
        del kept[next(iter(kept))]


def direction_of(view: str) -> tuple[float, float] | None:
    """Return the angles of a direction's name or of "AZIMUTH,ELEVATION" in degrees; None: the view is a camera's path."""
    if view in DIRECTIONS:
        return DIRECTIONS[view]
    first, comma, second = view.partition(",")
    try:
        angles = float(first), float(second)
    except ValueError:
        return None
    if not comma or not (abs(angles[0]) <= 360 and abs(angles[1]) <= 89):  # not of nan
        sentence = "a direction is AZIMUTH,ELEVATION in degrees, the first from -360 to 360, the second from -89 to 89"
        raise SettingsError(sentence, where=view, code="view")
    return angles


def _looking_at(box: tuple[Any, Any], is_z_up: bool, azimuth: float, elevation: float) -> Camera:
    a, e = math.radians(azimuth), math.radians(elevation)
    back = np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)])
    right = np.array([math.cos(a), 0.0, -math.sin(a)])
    axes = np.column_stack([right, np.cross(back, right), back])
    if is_z_up:
        axes = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) @ axes
    low, high = (np.asarray(corner, np.float64) for corner in box)
    middle = (low + high) / 2
    corners = np.array([[low[0], high[0]], [low[1], high[1]], [low[2], high[2]]])
    points = np.array([[x, y, z] for x in corners[0] for y in corners[1] for z in corners[2]]) - middle
    along = points @ axes  # (8, 3): to the right, up, towards the camera
    reach = np.maximum(np.abs(along[:, 0]) / WINDOW[1], np.abs(along[:, 1]) / WINDOW[3]) * (1 + MARGIN)
    distance = max(float((along[:, 2] + reach).max()), 1e-9)
    placed = np.eye(4)
    placed[:3, :3] = axes
    placed[:3, 3] = middle + distance * axes[:, 2]
    nearest = usd.nearest_of(distance)
    return Camera("", placed, Projection.PERSPECTIVE, WINDOW, (0.0, FAR), nearest=nearest)


def _key(asked: Mapping[str, Any], view: str) -> tuple[object, ...]:
    return view, asked["frame"], asked["time_code"], asked["size"], tuple(asked["variants"]), asked["taxonomy"]


def _within(size: tuple[int, int], side: int) -> tuple[int, int]:
    """Return the size in proportion, at no more than `side` pixels across."""
    scale = min(side / max(size), 1.0)
    return max(round(size[0] * scale), 1), max(round(size[1] * scale), 1)


def _facts(view: str, image: Image) -> dict[str, Any]:
    width, height = image.resolution
    camera = image.camera
    error = (image.report.get("error") or {}).get("relmse") or {}
    return {
        "view": view,
        "camera": camera.path if camera is not None else "",
        "position": None if camera is None else [_short(v) for v in camera.world_from_camera[:3, 3]],
        "size": [width, height],
        "samples_per_pixel": image.report["samples_per_pixel"],
        "relmse": _finite(error.get("estimate")),
    }


def _seen(image: Image, taxonomy: str) -> dict[str, Any]:
    """Return what is seen by prim, largest first: share of the picture, box in pixels, middle, distance, label."""
    prims, distance = image.aovs["prim"], image.aovs["distance"].values[..., 0]
    labels = image.aovs.get(f"labels:{taxonomy}")
    numbers, counts = np.unique(prims.values[..., 0], return_counts=True)
    order = [k for k in np.argsort(-counts, kind="stable") if numbers[k] != 0]
    rows = []
    for k in order[:MOST_ROWS]:
        mask = prims.values[..., 0] == numbers[k]
        y, x = np.nonzero(mask)
        instances = np.unique(image.aovs["instance"].values[..., 0][mask])
        row = {
            "prim": prims.ids.get(int(numbers[k]), "?"),
            "share_percent": round(100 * float(counts[k]) / mask.size, 2),
            "box": _box(mask),
            "middle": [int(np.median(x)), int(np.median(y))],
            "distance": _finite(float(distance[mask].min())),
        }
        if (shown_instances := int(np.count_nonzero(instances))) > 1:
            row["instances"] = shown_instances
        if labels is not None and (found := np.unique(labels.values[..., 0][mask]))[-1]:
            row["label"] = ", ".join(labels.ids.get(int(n), "?") for n in found if n)
        rows.append(row)
    more = len(order) - len(rows)
    background = float((prims.values[..., 0] == 0).mean())
    return {"seen": rows, "more": f"{more} more" if more else "", "background_percent": round(100 * background, 2)}


@dataclass(frozen=True, eq=False)
class Changed:
    """What changed between two pictures of the same samples. `rows`: by prim; `mask` (H, W): pixels."""

    rows: list[dict[str, Any]]
    mask: npt.NDArray[np.bool_]


def _changes(old: Image, new: Image, result: Comparison) -> Changed:
    """Return the prims that changed beyond noise, most of the picture first, and the pixels of the change.

    Both sides have the same samples: what the change does not reach has the same bits. Where it only reaches other paths, the
    difference is noise without a sign, so a prim has changed where the mean difference of its pixels is SURE_Z of its standard
    errors, by their spread. Which prim a pixel's centre shows has no noise at all.
    """
    d, mean = result.of.d[:3], result.of.mean[:3].mean(axis=0)  # without alpha
    sides = [(image.aovs["prim"].values[..., 0], {0: BACKGROUND, **image.aovs["prim"].ids}) for image in (old, new)]
    pixels = [{name: ids == number for number, name in names.items()} for ids, names in sides]
    tiles = _in_changed_tiles(result)
    floor = result.tolerance * abs(float(mean.mean()))
    nobody = np.zeros(mean.shape, np.bool_)
    mask, found = result.of.broken.copy(), []
    differs = (d != 0).any(axis=0) & (_blurred(np.abs(d).mean(axis=0)) > floor)
    for name in sorted(pixels[0].keys() | pixels[1].keys()):
        was, is_now = (side.get(name, nobody) for side in pixels)
        its, moved = was | is_now, was != is_now
        change, is_sure = _mean_change(d[:, was & is_now], mean[was & is_now], result.tolerance)
        here = differs & its & (tiles | moved | is_sure)
        if not here.any() and (not moved.any() or name == BACKGROUND):
            continue
        mask |= here
        row = {
            "prim": name,
            "changed_percent_of_picture": round(100 * float(here.mean()), 3),
            "brighter_percent": _percent(change),
            "box": _box(here if here.any() else moved),
            "seen_percent_before": round(100 * float(was.mean()), 2),
            "seen_percent_after": round(100 * float(is_now.mean()), 2),
        }
        found.append((int((here | moved).sum() if name != BACKGROUND else here.sum()), row))
    found.sort(key=lambda item: -item[0])
    return Changed([row for _, row in found], mask)


def _mean_change(d: npt.NDArray[np.float64], mean: npt.NDArray[np.float64], tolerance: float) -> tuple[float | None, bool]:
    """Return the change (C, N) of a prim's pixels relative to their mean, and whether it is beyond noise and the tolerance."""
    if d.shape[1] == 0:
        return None, False
    total = max(abs(float(mean.sum())), 1e-30)
    size = np.abs(d.sum(axis=1)) / total
    spread = d.std(axis=1) * math.sqrt(d.shape[1])
    is_sure = d.shape[1] >= FEWEST_PIXELS and bool(((np.abs(d.sum(axis=1)) > SURE_Z * spread) & (size >= tolerance)).any())
    return float(d.mean(axis=0).sum() / total), is_sure


def _in_changed_tiles(result: Comparison) -> npt.NDArray[np.bool_]:
    found = np.zeros(result.of.judged.shape, np.bool_)
    for tile in result.tiles:
        if tile.verdict is Verdict.CHANGED:
            x0, y0, x1, y1 = tile.box
            found[y0:y1, x0:x1] = True
    return found


def _blurred(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    height, width = values.shape
    wide = np.pad(values, 1, mode="edge")
    parts = [wide[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.asarray(np.mean(parts, axis=0))


def _marked(rgb: npt.NDArray[np.uint8], mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
    """Return the picture in pale grey, with the pixels of the mask in red."""
    grey = 128 + rgb.mean(axis=2, keepdims=True) / 2
    found = np.repeat(grey, 3, axis=2)
    found[mask] = 0.35 * found[mask] + 0.65 * np.array([230.0, 0.0, 0.0])
    return np.asarray(found, np.uint8)


def shown(image: Image) -> npt.NDArray[np.uint8]:
    """Return display values (H, W, 3), over grey where the picture is transparent."""
    rgba = image.shown.to_uint8().astype(np.float64)
    alpha = rgba[..., 3:] / 255
    return np.asarray(np.rint(rgba[..., :3] * alpha + 110 * (1 - alpha)), np.uint8)


def _smaller(rgb: npt.NDArray[np.uint8], side: int) -> npt.NDArray[np.uint8]:
    """Return the picture at no more than this many pixels across, by whole steps."""
    step = -(-max(rgb.shape[:2]) // side)
    height, width = (n // step * step for n in rgb.shape[:2])
    if step == 1 or not height or not width:
        return rgb[:side, :side]
    parts = rgb[:height, :width].reshape(height // step, step, width // step, step, 3)
    return np.asarray(np.rint(parts.mean(axis=(1, 3))), np.uint8)


def pictures_of(found: Mapping[str, npt.NDArray[np.uint8]]) -> list[dict[str, Any]]:
    """Return the pictures as files in base64: PNG where that is small, else JPEG, none larger than is allowed."""
    most = min(PICTURE_BYTES, RESULT_BYTES // max(len(found), 1))
    return [{"name": name, "size": [rgb.shape[1], rgb.shape[0]], **_encoded(rgb, most)} for name, rgb in found.items()]


def _encoded(rgb: npt.NDArray[np.uint8], most: int) -> dict[str, str]:
    with tempfile.TemporaryDirectory() as folder:
        png = Path(folder) / "picture.png"
        write_view(rgb, str(png))
        content, kind = png.read_bytes(), "image/png"
        for quality in QUALITIES:
            if len(content) <= most:
                break
            content, kind = _jpeg(rgb, Path(folder) / "picture.jpg", quality), "image/jpeg"
    if len(content) > most:
        return _encoded(np.ascontiguousarray(rgb[::2, ::2]), most)
    return {"type": kind, "data": base64.b64encode(content).decode()}


def _jpeg(rgb: npt.NDArray[np.uint8], path: Path, quality: int) -> bytes:
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(rgb.shape[1], rgb.shape[0], 3, oiio.UINT8)
    spec.attribute("Compression", f"jpeg:{quality}")
    file = oiio.ImageOutput.create(str(path))
    if file is None or not file.open(str(path), spec) or not file.write_image(np.ascontiguousarray(rgb)) or not file.close():
        raise PrimrayError(f"the picture could not be encoded: {oiio.geterror()}", code="picture-encoding")
    return path.read_bytes()


def _noted(image: Image) -> Any:
    return bounded(image.report.get("diagnostics", []))


def bounded(value: Any, rows: int = MOST_ROWS, chars: int = 400) -> Any:
    """Return JSON with every list cut to so many items, the last of which says how many more there are, and texts cut."""
    if isinstance(value, Mapping):
        items = list(value.items())
        kept = {str(name): bounded(item, rows, chars) for name, item in items[: 2 * rows]}
        return kept if len(items) <= 2 * rows else {**kept, "more": f"{len(items) - 2 * rows} more"}
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        found = [bounded(item, rows, chars) for item in value[:rows]]
        return found if len(value) <= rows else [*found, f"{len(value) - rows} more"]
    if isinstance(value, str):
        return value if len(value) <= chars else f"{value[:chars]}... ({len(value) - chars} more characters)"
    if isinstance(value, float):
        return _finite(value)
    return value


def _box(mask: npt.NDArray[np.bool_]) -> list[int] | None:
    """Return x0, y0, x1, y1 of the mask in pixels from the upper left, the end not included."""
    y, x = np.nonzero(mask)
    return None if not len(x) else [int(x.min()), int(y.min()), int(x.max()) + 1, int(y.max()) + 1]


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else _short(value)


def _percent(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else _short(100 * value)


def _short(value: float) -> float:
    return float(f"{value:.5g}")
