"""Readings as text: a table for spreadsheets, and a page with false colours to read and print."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Doubles
from ..version import __version__
from .readings import Reading

if TYPE_CHECKING:
    from .luminance import LuminancePicture
    from .measuring import Measurement

# Cividis (Nunez, Anderton, Renslow 2018), which is even in lightness and looks alike with every colour vision, at eighths.
_COLORS = np.array(
    [
        (0, 34, 78),
        (18, 53, 112),
        (59, 73, 108),
        (87, 93, 109),
        (112, 113, 115),
        (138, 134, 120),
        (165, 156, 116),
        (195, 179, 105),
        (254, 232, 56),
    ]
)
_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 60em; padding: 0 1em; color: #1a1a1a }
table { border-collapse: collapse; margin: 1em 0 }
td, th { padding: .2em .8em; text-align: right; border-bottom: 1px solid #ddd }
td:first-child, th:first-child { text-align: left } svg, img { max-width: 100%; height: auto } .unmet { color: #a00 }
svg text { font: 12px system-ui, sans-serif } @media print { body { margin: 0 } tr, svg { break-inside: avoid } }
"""
_CELL = 56  # pixels of a point of a grid


def shown(interval: tuple[float, float, float], shares: bool) -> str:
    """Return a value with half of its interval, to the digits that it holds: 412.3 ± 4.1 lx."""
    value, low, high = (100 * part for part in interval) if shares else interval
    half, unit = (high - low) / 2, "%" if shares else "lx"
    if half <= 0:
        return f"{value:.6g} ± 0 {unit}"
    digits = int(min(max(1 - np.floor(np.log10(half)), 0), 9))
    return f"{value:.{digits}f} ± {half:.{digits}f} {unit}"


def as_csv(found: Measurement) -> str:
    """Return a row for each meter (RFC 4180): where it is, its value and the ends of its 95 % interval."""
    text = io.StringIO()
    rows = csv.writer(text)
    unit = "share" if found.is_daylight_factor else "lux"
    rows.writerow(["name", "grid", "kind", "x", "y", "z", f"value_{unit}", f"low_{unit}", f"high_{unit}", "met"])
    for reading in found.readings:
        meter = reading.meter
        numbers = [*meter.position, reading.value, reading.low, reading.high]
        rows.writerow([meter.name, meter.grid, meter.kind.value, *(f"{n:.9g}" for n in numbers), str(reading.met).lower()])
    return text.getvalue()


def as_page(found: Measurement, stage: str, pictures: Sequence[LuminancePicture] = ()) -> str:
    """Return a page of its own (HTML, no scripts) with the readings, each grid in false colours, and pictures of luminance."""
    report, shares = found.report, found.is_daylight_factor
    what = "Daylight factors under the CIE overcast sky" if shares else "Illuminance"
    told = "All 95 % intervals hold together" if report["intervals"] == "simultaneous" else "Each value has its 95 % interval"
    parts = [
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{escape(what)}: {escape(stage)}</title>",
        f"<meta name=viewport content='width=device-width'><style>{_STYLE}</style><h1>{escape(what)}</h1>",
        f"<p>{escape(stage)}. {told}; half of it was to be {report['target']:.3g} of the value"
        f"{'' if found.met else ', <b class=unmet>and not reached everywhere</b>'}. "
        f"Maintenance factor {found.maintenance_factor:g}. primray {__version__}, seed {report['seed']}, "
        f"{report['samples']} samples a meter.</p>",
    ]
    for grid in found.grids:
        own = [reading for reading in found.readings if reading.meter.grid == grid.name]
        low, high = grid.uniformity[1:]
        parts.append(f"<h2>{escape(grid.name)}</h2><table><tr><th>mean<th>least<th>most<th>uniformity (least over mean)</tr>")
        parts.append(
            f"<tr><td>{shown(grid.mean, shares)}<td>{shown(grid.least, shares)}<td>{shown(grid.most, shares)}"
            f"<td>{grid.uniformity[0]:.3f} ({low:.3f} to {high:.3f})</tr></table>{_false_colors(own, shares)}"
        )
    parts += [_luminance(picture) for picture in pictures]
    parts.append("<h2>All meters</h2><table><tr><th>meter<th>x<th>y<th>z<th>reading</tr>")
    for reading in found.readings:
        x, y, z = reading.meter.position
        marked = "" if reading.met else " class=unmet"
        value = shown((reading.value, reading.low, reading.high), shares)
        parts.append(f"<tr{marked}><td>{escape(reading.meter.name)}<td>{x:.4g}<td>{y:.4g}<td>{z:.4g}<td>{value}</tr>")
    problems = [one for one in report["diagnostics"] if one["severity"] != "info"]
    parts.append("</table>")
    if problems:
        lines = "".join(f"<li>{escape(one['prim_path'])}: {escape(one['message'])}" for one in problems)
        parts.append(f"<h2>What was not taken as the stage says</h2><ul>{lines}</ul>")
    return "\n".join(parts) + "</html>\n"


def _false_colors(readings: list[Reading], shares: bool) -> str:
    """Return a drawing of a grid's readings, its last row on top."""
    places = [tuple(map(int, reading.meter.name.rpartition("[")[2][:-1].split(","))) for reading in readings]
    columns, rows = (1 + max(place[k] for place in places) for k in (0, 1))
    values = np.array([reading.value for reading in readings]) * (100 if shares else 1)
    low, high = float(values.min()), float(values.max())
    cells = []
    for (i, j), value in zip(places, values.tolist(), strict=True):
        share = (value - low) / (high - low) if high > low else 0.5
        color = _color(share)
        x, y = _CELL * i, _CELL * (rows - 1 - j)
        ink = "#fff" if share < 0.6 else "#000"
        cells.append(
            f"<rect x={x} y={y} width={_CELL} height={_CELL} fill='rgb({color})'/>"
            f"<text x={x + _CELL / 2:g} y={y + _CELL / 2 + 4:g} text-anchor=middle fill='{ink}'>{value:.3g}</text>"
        )
    size = f"width={_CELL * columns} height={_CELL * rows} viewBox='0 0 {_CELL * columns} {_CELL * rows}'"
    unit = "%" if shares else "lx"
    caption = (
        f"<p>{low:.4g} to {high:.4g} {unit}; columns along the first side of the grid, rows along the second, upwards.</p>"
    )
    return f"<svg {size} role=img aria-label='grid in false colours'>{''.join(cells)}</svg>{caption}"


def _luminance(picture: LuminancePicture) -> str:
    """Return a camera's picture in false colours, by the logarithm of luminance, with its legend."""
    from ..images.showing import png_source

    low, high = picture.scale
    span = math.log10(high / low)
    shares = np.clip(np.log10(np.maximum(picture.luminance, low) / low) / span, 0, 1)
    pixels = np.rint(colors_of(shares)).astype(np.uint8)
    value, least, most = picture.mean
    return (
        f"<h2>Luminance from {escape(picture.camera)}</h2>"
        f"<p><img src='{png_source(pixels)}' width={pixels.shape[1]} height={pixels.shape[0]} alt='luminance in false colours'>"
        f"{_legend(low, high)}</p><p>Mean {value:.4g} cd/m2 ({least:.4g} to {most:.4g}); the darkest colour is {low:.3g} cd/m2 "
        f"and less, the brightest {high:.3g} cd/m2 and more; {float(picture.luminance.max()):.4g} cd/m2 at most.</p>"
    )


def _legend(low: float, high: float) -> str:
    """Return a bar of the scale's colours, with 1, 2 and 5 of each decade in cd/m2."""
    span, width, height = math.log10(high / low), 480, 16
    steps = "".join(f"<rect x={x} width=4 height={height} fill='rgb({_color((x + 2) / width)})'/>" for x in range(0, width, 4))
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [
        m * 10.0**k for k in decades for m in ((1, 2, 5) if span <= 3 else (1,)) if low <= m * 10.0**k * 1.0001 <= high * 1.001
    ]
    words = "".join(
        f"<text x={min(max(width * math.log10(tick / low) / span, 12), width - 8):.1f} y={height + 14} text-anchor=middle>"
        f"{tick:.4g}</text>"
        for tick in ticks
    )
    size = f"width={width + 50} height={height + 20} viewBox='0 0 {width + 50} {height + 20}'"
    unit = f"<text x={width + 6} y={height + 14}>cd/m2</text>"
    return f"<br><svg {size} role=img aria-label='legend in cd/m2'>{steps}{words}{unit}</svg>"


def colors_of(shares: Doubles) -> Doubles:
    """Return the colours (..., 3), 0 to 255, of shares of the scale."""
    at = np.linspace(0, 1, len(_COLORS))
    return np.stack([np.interp(shares, at, _COLORS[:, c]) for c in range(3)], axis=-1)


def _color(share: float) -> str:
    return ",".join(str(round(float(c))) for c in colors_of(np.array(share)))
