"""A comparison as JSON, as text and as a difference picture.

The picture shows each pixel's difference in units of its noise, blue if B is darker, red if brighter. Changed tiles have yellow
frames, undecided ones grey corners. Values are plain 8-bit, without colour management.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Doubles
from ..errors import SettingsError
from ..images.image import Image, check_output_path, write_png
from .comparison import AovComparison, Comparison, Finding, Needs, Tile, Verdict
from .difference import ALPHA, Difference, local_deviation

TILES_SHOWN = 10
AOV_TILES_SHOWN = 3
_NEWS = 0.1  # times the tolerance: smaller findings are not printed
_ORDER = (Verdict.CHANGED, Verdict.UNDECIDED, Verdict.UNCHANGED)
_CHANNELS = {"R": "red", "G": "green", "B": "blue", ALPHA: "alpha"}


def as_json(comparison: Comparison) -> dict[str, Any]:
    return {
        "verdict": comparison.verdict.value,
        "identical": comparison.identical,
        "by": comparison.by,
        "alpha": comparison.alpha,
        "tolerance": comparison.tolerance,
        "relation": comparison.of.relation.name.lower(),
        "samples_per_pixel": {"a": comparison.of.samples[0], "b": comparison.of.samples[1]},
        "relative_mean_difference": comparison.relative,
        "relative_mean_difference_error": comparison.relative_error,
        "image": _finding_json(comparison.finding),
        "needs": asdict(comparison.needs) if comparison.needs else None,
        "unjudged_pixels": comparison.unjudged_pixels,
        "notes": list(comparison.notes),
        "count": {verdict.value: comparison.count(verdict) for verdict in _ORDER},
        "tiles": [
            {
                "box": list(tile.box),
                "verdict": tile.verdict.value,
                "relative_mean_difference": tile.relative,
                "resolution": _number(tile.resolution),
                "finding": _finding_json(tile.finding),
            }
            for tile in comparison.tiles
        ],
        "aovs": {aov.name: _aov_json(aov) for aov in comparison.aovs},
    } | ({} if comparison.flip is None else {"flip": comparison.flip.as_json()})


def _aov_json(aov: AovComparison) -> dict[str, Any]:
    return {
        "verdict": aov.verdict.value,
        "by": aov.by,
        "identical": aov.identical,
        "count": {verdict.value: aov.count(verdict) for verdict in _ORDER},
        "tiles": [{"box": list(t.box), "verdict": t.verdict.value, "differs": _number(t.differs)} for t in aov.tiles],
    }


def _finding_json(finding: Finding | None) -> dict[str, Any] | None:
    if finding is None:
        return None
    return {
        "kind": finding.kind,
        "channel": finding.channel,
        "box": list(finding.box),
        "p": finding.p if finding.kind != "values" else None,  # without errors there is no probability
        "relative": _number(finding.relative),
        "signed": _number(finding.signed),
    }


def _number(value: float) -> float | None:
    """Return the value, or None for an infinity or NaN, which JSON lacks."""
    return value if math.isfinite(value) else None


def lines(comparison: Comparison, name_a: str, name_b: str) -> Iterator[str]:
    """Yield the comparison as text, the verdict first and then the worst tiles."""
    height, width = comparison.of.judged.shape
    yield f"{comparison.verdict.value}: {name_a} (A) and {name_b} (B), {width} x {height}"
    if comparison.identical:
        yield "  the pictures are identical"
    elif comparison.by == "errors":
        yield from _picture_lines(comparison)
    else:
        yield from _value_lines(comparison)
    for aov in comparison.aovs:
        yield from _aov_lines(aov)
    for note in comparison.notes:
        yield f"  note: {note}"


def _picture_lines(comparison: Comparison) -> Iterator[str]:
    assert comparison.relative_error is not None
    yield (
        f"  the picture as a whole: B is {_percent(comparison.relative)} {_than(comparison.relative)} "
        f"(standard error {_percent(comparison.relative_error)})"
    )
    if comparison.finding is not None and _worth_telling(comparison.finding, comparison.tolerance):
        yield f"  the picture as a whole: {_words(comparison.finding, comparison.tolerance)}"
    yield from _tile_lines(comparison)
    if comparison.needs is not None:
        yield f"  {needs_sentence(comparison.needs, comparison.tolerance)}"
    if comparison.unjudged_pixels:
        yield f"  {comparison.unjudged_pixels} pixels have no error estimate (fewer than two samples, or not finite)"


def _tile_lines(comparison: Comparison) -> Iterator[str]:
    counts = ", ".join(f"{comparison.count(verdict)} {verdict.value}" for verdict in _ORDER if comparison.count(verdict))
    yield f"  tiles: {counts}"
    shown = [
        tile
        for tile in worst_tiles(comparison)
        if tile.verdict is not Verdict.UNCHANGED or (tile.finding and _worth_telling(tile.finding, comparison.tolerance))
    ]
    for tile in shown[:TILES_SHOWN]:
        yield f"    {tile_line(tile, comparison.tolerance, comparison.by)}"
    if len(shown) > TILES_SHOWN:
        yield f"    and {len(shown) - TILES_SHOWN} more"


def _value_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a comparison without standard errors as text: sizes and their measure, but no probabilities."""
    white = " of white" if comparison.by == "display" else ""
    if comparison.finding is not None and comparison.finding.kind == "values":
        size = _percent(comparison.finding.relative)
        whole = f"B is {_percent(comparison.relative)}{white} {_than(comparison.relative)}"
        yield f"  the picture as a whole: {whole}; root mean square of the difference: {size}{white}"
    yield from _tile_lines(comparison)
    if comparison.unjudged_pixels:
        yield f"  {comparison.unjudged_pixels} pixels are not finite in either picture"
    if comparison.flip is not None:
        yield f"  {comparison.flip.line()}"


_BY = {
    "errors": "values differ by",
    "values": "values differ by",
    "names": "something else in",
    "coverage": "a coverage differs by",
}


def _aov_lines(aov: AovComparison) -> Iterator[str]:
    counts = ", ".join(f"{aov.count(verdict)} {verdict.value}" for verdict in _ORDER if aov.count(verdict))
    yield f"  AOV {aov.name}: " + ("identical" if aov.identical else f"{aov.verdict.value}; tiles: {counts}")
    changed = sorted((tile for tile in aov.tiles if tile.verdict is Verdict.CHANGED), key=lambda tile: -tile.differs)
    for tile in changed[:AOV_TILES_SHOWN]:
        x0, y0, x1, y1 = tile.box
        what = f"{_BY[aov.by]} {_percent(tile.differs)}" + (" of the pixels" if aov.by == "names" else "")
        yield f"    x {x0} to {x1 - 1}, y {y0} to {y1 - 1}: {what}"
    if len(changed) > AOV_TILES_SHOWN:
        yield f"    and {len(changed) - AOV_TILES_SHOWN} more"


def _worth_telling(finding: Finding, tolerance: float) -> bool:
    """Return whether a finding is large enough to print.

    Rounding of another processor is significant if random numbers are repeated, but irrelevant.
    """
    return finding.relative >= _NEWS * tolerance


def worst_tiles(comparison: Comparison) -> list[Tile]:
    """Return tiles by severity: changed ones by difference, undecided ones by resolution, then the rest."""

    def key(tile: Tile) -> tuple[int, float]:
        by_finding = tile.finding is not None and (tile.verdict is Verdict.CHANGED or tile.finding.kind == "values")
        return _ORDER.index(tile.verdict), -(tile.finding.relative if by_finding and tile.finding else tile.resolution)

    return sorted(comparison.tiles, key=key)


def tile_line(tile: Tile, tolerance: float, by: str) -> str:
    """Return the position of a tile and the reason for its verdict."""
    x0, y0, x1, y1 = tile.box
    place = f"x {x0} to {x1 - 1}, y {y0} to {y1 - 1}"
    if tile.verdict is Verdict.UNDECIDED:
        hides = f"up to {_percent(tile.resolution)}" if math.isfinite(tile.resolution) else "of any size"
        found = f"; {_words(tile.finding, tolerance)}" if tile.finding else ""
        return f"{place}: undecided, noise could hide a difference {hides}{found}"
    assert tile.finding is not None
    if tile.finding.kind == "values":
        size = f"{_percent(tile.finding.relative)}{' of white' if by == 'display' else ''}"
        return f"{place}: differs by {size}" + ("" if tile.verdict is Verdict.CHANGED else ", below the tolerance")
    return f"{place}: {_words(tile.finding, tolerance)}"


def _words(finding: Finding, tolerance: float) -> str:
    x0, y0, x1, y1 = finding.box
    channel = _CHANNELS.get(finding.channel, "a channel")
    size = _percent(finding.relative)
    if finding.kind == "not-finite":
        return "finite in one picture, NaN or infinite in the other"
    if finding.kind in ("shift", "spot"):
        inside = f" in the {x1 - x0} x {y1 - y0} pixels from x {x0}, y {y0}" if x1 - x0 <= 16 else ""
        what = (
            "a few pixels differ far beyond noise, by" if finding.kind == "spot" else f"{channel} is {_than(finding.signed)} by"
        )
        text = f"{what} {size}{inside}"
    elif finding.kind == "brightness":
        text = f"{channel} is {_than(finding.signed)} by {size}"
    elif finding.kind in ("moved-x", "moved-y"):
        ways = ("right", "left") if finding.kind == "moved-x" else ("down", "up")
        way = ways[finding.signed < 0]
        text = f"looks moved to the {way} by about {abs(finding.signed):.2g} px ({channel} differs by {size})"
        text = text.replace("to the up", "up").replace("to the down", "down")
    else:
        text = f"{channel} has a different pattern, by {size}"
    below = "" if finding.relative >= tolerance else ", below the tolerance"
    return f"{text}{below} (false alarm: {_probability(finding.p)})"


def _than(signed: float) -> str:
    return "darker" if signed < 0 else "brighter"


def _percent(value: float) -> str:
    percent = abs(value) * 100
    return f"{percent:.0f} %" if percent >= 10 else f"{percent:.2g} %"


def _probability(p: float) -> str:
    return "less than 1 in 10^9" if p < 1e-9 else f"at most {p:.1g}"


def needs_sentence(needs: Needs, tolerance: float) -> str:
    if needs.factor is None:
        return (
            "more samples cannot decide it: tiles are too small, pixels have no error, or a picture does not state its samples"
        )
    if needs.a is None or needs.b is None:
        text = f"to detect differences of {_percent(tolerance)}, both need {needs.factor:.2g} times the samples"
    else:
        text = f"to detect differences of {_percent(tolerance)}, A needs {needs.a} more samples a pixel and B {needs.b}"
    alone = [f"{name} alone {more}" for name, more in (("A", needs.a_alone), ("B", needs.b_alone)) if more is not None]
    return text + (f", or {', or '.join(alone)}" if alone else "")


FULL = 4.0  # standard deviations at which the colour saturates
_DARKER, _SAME, _BRIGHTER = np.array([40.0, 90, 255]), np.array([24.0, 24, 24]), np.array([255.0, 60, 30])
_UNJUDGED = np.array([90.0, 0, 90])
_FRAMES = {Verdict.CHANGED: (255, 220, 0), Verdict.UNDECIDED: (130, 130, 130)}
_EXTENSIONS = (".png", ".exr")


def check_difference_path(path: str | os.PathLike[str]) -> Path:
    if Path(path).suffix.lower() not in _EXTENSIONS:
        known = " or ".join(_EXTENSIONS)
        raise SettingsError(f"a difference picture's name must end in {known}", where=str(path), code="unknown-extension")
    return check_output_path(path)


def save_difference(comparison: Comparison, path: str | os.PathLike[str]) -> Path:
    """Write the difference.

    A PNG holds the difference picture; an EXR holds B - A in R, G, B, and that over its noise in z.R, z.G, z.B.
    """
    path = check_difference_path(path)
    of = comparison.of
    if path.suffix.lower() == ".png":
        return write_png(picture(comparison), path)
    planes = np.concatenate([of.d[:3], z_scores(of)])
    names = ("R", "G", "B", "z.R", "z.G", "z.B")
    return Image(np.moveaxis(planes, 0, 2).astype(np.float32), channels=names, frame=of.frame).save(path)


def z_scores(of: Difference) -> Doubles:
    """Return the difference (3, H, W) in standard deviations, estimated in each pixel's neighbourhood."""
    noise = np.stack([local_deviation(of, channel) for channel in range(3)])
    return np.divide(of.d[:3], noise, out=np.zeros_like(noise), where=noise > 0)


def picture(comparison: Comparison) -> np.ndarray[Any, Any]:
    """Return the 8-bit difference picture (H, W, 3)."""
    of = comparison.of
    z = z_scores(of)
    strongest = np.take_along_axis(z, np.abs(z).argmax(axis=0)[None], axis=0)[0]
    share = np.clip(np.abs(strongest) / FULL, 0, 1)[..., None]
    colors = _SAME + share * (np.where(strongest[..., None] > 0, _BRIGHTER, _DARKER) - _SAME)
    colors[~of.judged] = _UNJUDGED
    colors[of.broken] = 255
    out: np.ndarray[Any, Any] = (colors + 0.5).astype(np.uint8)
    for verdict in (Verdict.UNDECIDED, Verdict.CHANGED):  # frames of changed tiles cover those of their neighbours
        for tile in comparison.tiles:
            if tile.verdict is verdict:
                _frame(out, tile.box, verdict)
    return out


def _frame(out: np.ndarray[Any, Any], box: tuple[int, int, int, int], verdict: Verdict) -> None:
    x0, y0, x1, y1 = box
    color = _FRAMES[verdict]
    if verdict is Verdict.CHANGED:
        out[[y0, y1 - 1], x0:x1] = color
        out[y0:y1, [x0, x1 - 1]] = color
    else:
        for y in (y0, y1 - 1):
            for x in (x0, x1 - 1):
                out[max(y - 1, y0) : min(y + 2, y1), x] = out[y, max(x - 1, x0) : min(x + 2, x1)] = color
