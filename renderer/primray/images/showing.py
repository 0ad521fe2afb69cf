"""Display of a picture: as interactive HTML under a notebook's cell, or in the desktop's viewer.

The HTML has sliders for exposure and per-pixel error and needs no kernel. A browser gets the picture's logarithms in 12 bits,
to which exposure is added, and the view as a lookup cube, which it interpolates; where scripts do not run, it shows a PNG.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from base64 import b64encode
from collections.abc import Iterable, Mapping
from functools import cache, lru_cache
from html import escape
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from ..diagnostic_messages import diagnostics_html, display, in_notebook
from ..errors import PrimrayError
from .exposure import View, as_viewed
from .writers import write_view

if TYPE_CHECKING:
    from .image import Image


def show(image: Image) -> None:
    """Show the image; PrimrayError if there is neither a notebook nor a desktop."""
    if in_notebook():
        display(image)
        return
    viewer = _viewer()
    if viewer is None:
        raise PrimrayError("there is no desktop to show a picture on; image.save('picture.png') writes it", code="no-display")
    # The viewer may read the file after this process has ended, so it is left to the system's cleanup of temporary files.
    path = image.save(Path(tempfile.mkdtemp(prefix="primray-"), "picture.png"))
    try:
        subprocess.Popen([viewer, path], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    except OSError as error:
        raise PrimrayError(f"{viewer} cannot be started: {error.strerror}", where=str(path), code="no-display") from error


def _viewer() -> str | None:
    """Return the command that opens a file in the desktop's viewer, or None."""
    if sys.platform == "darwin":
        return shutil.which("open")
    has_desktop = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return shutil.which("xdg-open") if has_desktop else None


_LAYER = "position: absolute; left: 0; top: 0; width: 100%; height: 100%"


def picture_page(
    png: bytes,
    pixels: Floats,
    errors: Floats | None,
    view: View,
    figures: Iterable[str],
    diagnostics: Iterable[Mapping[str, str]],
) -> str:
    """Return the HTML of a picture.

    `pixels` (H, W, 4) and `errors` (H, W, 3) are shown, `png` is the same in its view, and `figures` are printed below.
    """
    height, width = pixels.shape[:2]
    colors, alpha = as_viewed(reduced(pixels))
    levels, brightest = logarithms(colors)
    relative = None if errors is None else relative_errors(pixels, errors)
    parts = [
        f'<img data-part="base" src="{_source(png)}" width="{width}" height="{height}" alt="the picture"'
        ' style="display: block; max-width: 100%; height: auto">',
        f'<canvas data-part="canvas" hidden style="{_LAYER}; background: inherit"></canvas>',
    ]
    if relative is not None:
        hot = png_source(heat(reduced(relative[..., None].astype(np.float32))[..., 0].astype(np.float64)))
        parts.append(f'<img data-part="heat" src="{hot}" alt="" style="{_LAYER}; opacity: 0; pointer-events: none">')
    hidden = [("levels", png_source(levels)), ("cube", png_source(view_cube(view)))]
    if alpha is not None:
        hidden.append(("alpha", png_source(np.repeat(np.rint(alpha * 255).astype(np.uint8), 3, axis=2))))
    parts += [f'<img data-part="{name}" src="{source}" alt="" hidden style="display: none">' for name, source in hidden]
    picture = f'<div style="position: relative; display: inline-block; max-width: 100%; line-height: 0">{"".join(parts)}</div>'
    told = " · ".join(escape(figure) for figure in figures)
    return (
        f'<div data-primray data-brightest="{brightest!r}" data-range="[{CUBE_STOPS[0]}, {CUBE_STOPS[1]}]"'
        f' style="font-family: sans-serif; font-size: 0.85em">{picture}{_controls(relative is not None)}'
        f'<div style="opacity: 0.8; margin-top: 0.3em">{told}</div>{diagnostics_html(diagnostics)}'
        f"<script>{_script()}</script></div>"
    )


def _controls(has_errors: bool) -> str:
    exposure = (
        '<label>exposure <input data-part="exposure" type="range" min="-6" max="6" step="0.1" value="0"'
        ' style="width: 12em; vertical-align: middle">'
        ' <span data-part="stops" style="font-family: monospace">0.0</span> stops</label>'
    )
    error = (
        '<label>error <input data-part="error" type="range" min="0" max="100" step="5" value="0"'
        ' style="width: 8em; vertical-align: middle"></label> <span data-part="legend" style="visibility: hidden">0.1 % '
        f'<span style="display: inline-block; width: 8em; height: 0.8em; vertical-align: middle; background: {gradient()}">'
        "</span> 100 %</span>"
    )
    shown = f"{exposure} &emsp; {error}" if has_errors else exposure
    return f'<div data-part="controls" hidden style="margin-top: 0.4em">{shown}</div>'


def figures_of(resolution: tuple[int, int], report: Mapping[str, Any]) -> list[str]:
    """Return the parts of the line below a picture, from its report; without a report, only the size."""
    told = [f"{resolution[0]} x {resolution[1]}"]
    low, high = report.get("samples_per_pixel", (0, 0))
    if high:
        told.append(f"{low} samples a pixel" if low == high else f"{low} to {high} samples a pixel")
    known = (report.get("error") or {}).get("relmse")
    if known:
        value, low_end, high_end = (100 * value**0.5 for value in (known["estimate"], *known["ci95"]))
        told.append(f"error {value:.3g} % (95 %: {low_end:.3g} to {high_end:.3g})")
    seconds = sum((report.get("stages_s") or {}).values())
    if seconds:
        told.append(f"{seconds:.1f} s")
    return told


@cache
def _script() -> str:
    return files(__package__).joinpath("picture.js").read_text(encoding="utf-8")


def png_source(values: Bytes) -> str:
    """Return a PNG of 8-bit values (H, W, C) as the source of an image in HTML."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "part.png")
        write_view(np.ascontiguousarray(values), str(path))
        return _source(path.read_bytes())


def _source(png: bytes) -> str:
    return f"data:image/png;base64,{b64encode(png).decode('ascii')}"


LEAST, MOST = 1e-3, 1.0
# From black through blue, red and yellow to white: brighter is worse, also for colour-blind viewers.
RAMP = np.array([(0, 0, 10), (40, 20, 120), (180, 40, 90), (250, 150, 30), (255, 255, 230)], np.float64)


def relative_errors(pixels: Floats, errors: Floats) -> Doubles | None:
    """Return errors (H, W) weighted as in relMSE, with squares averaged over 3 x 3 pixels; None if no error is known."""
    known = np.asarray(np.isfinite(errors).all(axis=2))
    if not known.any():
        return None
    squares = np.where(known[..., None], errors, 0.0).astype(np.float64) ** 2
    weighed = (squares / (pixels[..., :3].astype(np.float64) ** 2 + 0.01)).mean(axis=2)
    padded = np.pad(weighed, 1, mode="edge")
    height, width = weighed.shape
    around = sum(padded[y : y + height, x : x + width] for y in range(3) for x in range(3))
    roots: Doubles = np.sqrt(np.asarray(around) / 9)
    return roots


def heat(errors: Doubles) -> npt.NDArray[np.uint8]:
    """Return colours (H, W, 3) of the ramp for errors (H, W)."""
    span = np.log(MOST / LEAST)
    place = np.log(np.maximum(errors, LEAST) / LEAST) / span * (len(RAMP) - 1)
    channels = [np.interp(place, np.arange(len(RAMP)), RAMP[:, channel]) for channel in range(3)]
    colors: npt.NDArray[np.uint8] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    return colors


def gradient() -> str:
    """Return the ramp as a CSS gradient, for the legend."""
    return "linear-gradient(to right, {})".format(", ".join("rgb({:.0f}, {:.0f}, {:.0f})".format(*color) for color in RAMP))


Bytes = npt.NDArray[np.uint8]

MOST_PIXELS = 640 * 360  # larger pictures are averaged down, to keep pages with many pictures small
DARKEST = -12.0  # logarithm of base 2
LEVELS = 4095
CUBE = 33  # points per side
CUBE_STOPS = (DARKEST, 12.0)


def reduced(values: Floats) -> Floats:
    """Return (H, W, C) averaged over square blocks to at most MOST_PIXELS pixels."""
    height, width = values.shape[:2]
    block = 1
    while (height // block) * (width // block) > MOST_PIXELS:
        block += 1
    if block == 1:
        return values
    rows, columns = height // block, width // block
    cut = values[: rows * block, : columns * block]
    means: Floats = cut.reshape(rows, block, columns, block, -1).mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
    return means


def logarithms(rgb: Floats) -> tuple[Bytes, float]:
    """Return (2 H, W, 3) logarithms and the value of the highest level.

    The upper half has the high 8 of 12 bits, the lower half the low 4; level 0 is black.
    """
    finite = np.where(np.isfinite(rgb), rgb, np.float32(0))
    brightest = max(float(np.log2(max(float(finite.max(initial=0.0)), 1e-30))), 0.0) + 1e-6
    stops = np.log2(np.maximum(finite, np.float32(2.0**DARKEST)))
    level = np.rint((stops - DARKEST) / (brightest - DARKEST) * LEVELS).astype(np.uint16)
    return np.concatenate([level >> 4, (level & 15) << 4]).astype(np.uint8), brightest


@lru_cache(maxsize=8)
def view_cube(view: View) -> Bytes:
    """Return the view as display values (CUBE, CUBE * CUBE, 3).

    Red runs from left to right in a square, green from square to square, blue downwards.
    """
    axis: Doubles = np.exp2(np.linspace(*CUBE_STOPS, CUBE))
    axis[0] = 0.0
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    grid = np.stack([red, green, blue], axis=-1).reshape(CUBE, CUBE * CUBE, 3).astype(np.float32)
    return np.rint(np.clip(view.shown(grid), 0, 1) * 255).astype(np.uint8)
