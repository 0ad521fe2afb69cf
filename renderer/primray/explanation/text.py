"""An explained pixel as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from .parts import Part

LEAST = 5e-4  # share of the pixel, or its error, that is printed
SHOWN = 3  # of the paths that make the noise

if TYPE_CHECKING:
    from .explained import ExplainedPixel


def lines(pixel: ExplainedPixel, most: int) -> list[str]:
    from .explained import TITLES

    x, y = pixel.pixel
    samples = "1 sample" if pixel.samples == 1 else f"{pixel.samples} samples"
    text = [f"{pixel.scene}, pixel {x} {y} of {pixel.camera or 'the automatic camera'}, {samples}"]
    if pixel.shown is not None:
        shown = pixel.shown
        where = f" in {shown.instance}" if shown.instance else ""
        text.append(f"shows {shown.prim}{where}{f' ({shown.material})' if shown.material else ''} at {shown.distance:.4g}")
    error = "" if pixel.error is None else f" +- {_color(pixel.error)}"
    text.append(f"light {_color(pixel.value)}{error}, alpha {pixel.alpha:.3g}")
    for name, parts in pixel.splits.items():
        text += ["", TITLES[name], *_table(parts, most)]
    text += [*_noise(pixel), *_edits(pixel)]
    if has_rare(pixel):
        text += ["", "?  paths so rare that the error is hardly known: the true part may be several times larger, or smaller"]
    return text


def has_rare(pixel: ExplainedPixel) -> bool:
    """Return whether parts are known so badly that they have a question mark."""
    return any(part.is_rare for parts in pixel.splits.values() for part in parts)


def most_of(parts: Sequence[Part], most: int) -> tuple[Sequence[Part], int, float]:
    """Return the largest parts, at most so many and none that is negligible; the number of others, and their share."""
    shown = [part for part in parts if max(part.share, part.share_error or 0.0) >= LEAST][:most]
    return shown, len(parts) - len(shown), sum(part.share for part in parts if part not in shown)


def _noise(pixel: ExplainedPixel) -> Iterator[str]:
    """Yield how few samples make half of the noise, and their paths."""
    worst = [path for path in pixel.noise if not path.is_random]
    total = sum(path.share for path in worst)
    if total <= 0:
        return
    yield ""
    yield f"noise: the {len(worst)} worst paths make {100 * total:.0f} % of it"
    for path in worst[:SHOWN]:
        yield f"  {100 * path.share:5.1f} %  {path.words}"


def _edits(pixel: ExplainedPixel) -> Iterator[str]:
    if not pixel.edits:
        return
    yield ""
    yield "edits tried on the 16 x 16 pixels around it: time to the same error, seconds of CPU gained there, change of light"
    for edit in pixel.edits:
        low, high = edit.times_range
        gain = " to ".join(f"{seconds:+.2g}" for seconds in edit.gain_s)
        change = f"{100 * edit.change:+.1f} % ({100 * edit.change_range[0]:+.1f} to {100 * edit.change_range[1]:+.1f})"
        verdict = "changes the picture" if edit.changes else "no change beyond noise"
        yield f"  {edit.times:5.2f} x ({low:.2f} to {high:.2f})  {gain:>14} s  {change:28} {verdict}: {edit.edit}"


def _table(parts: Sequence[Part], most: int) -> Iterator[str]:
    shown, count, rest = most_of(parts, most)
    for part in shown:
        error = " " * 9 if part.share_error is None else f" +- {100 * part.share_error:<4.1f}{'?' if part.is_rare else ' '}"
        yield f"  {100 * part.share:5.1f}{error} %  {_color(part.value):32} {part.name}"
    if count:
        yield f"  {100 * rest:5.1f}          %  {'':32} {count} more"


def _color(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
