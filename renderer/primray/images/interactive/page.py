"""Self-contained HTML of a picture with controls, figures and diagnostics; a plain PNG where scripts do not run."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ...arrays import Floats
from ...notices.notebook import diagnostics_html
from ..exposure import View, as_viewed
from ..files.writers import write_view
from .heat import gradient, heat, relative_errors
from .levels import CUBE_STOPS, Bytes, logarithms, reduced, view_cube

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
        hot = _png(heat(reduced(relative[..., None].astype(np.float32))[..., 0].astype(np.float64)))
        parts.append(f'<img data-part="heat" src="{hot}" alt="" style="{_LAYER}; opacity: 0; pointer-events: none">')
    hidden = [("levels", _png(levels)), ("cube", _png(view_cube(view)))]
    if alpha is not None:
        hidden.append(("alpha", _png(np.repeat(np.rint(alpha * 255).astype(np.uint8), 3, axis=2))))
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


def _png(values: Bytes) -> str:
    with TemporaryDirectory() as folder:
        path = Path(folder, "part.png")
        write_view(np.ascontiguousarray(values), str(path))
        return _source(path.read_bytes())


def _source(png: bytes) -> str:
    return f"data:image/png;base64,{b64encode(png).decode('ascii')}"
