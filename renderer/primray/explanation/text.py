"""An explained pixel as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from .parts import Part

if TYPE_CHECKING:
    from .explained import ExplainedPixel


def lines(pixel: ExplainedPixel, most: int) -> list[str]:
    from .explained import TITLES

    x, y = pixel.pixel
    text = [f"{pixel.scene}, pixel {x} {y} of {pixel.camera or 'the automatic camera'}, {pixel.samples} samples"]
    if pixel.shown is not None:
        shown = pixel.shown
        where = f" in {shown.instance}" if shown.instance else ""
        text.append(f"shows {shown.prim}{where}{f' ({shown.material})' if shown.material else ''} at {shown.distance:.4g}")
    error = "" if pixel.error is None else f" +- {_color(pixel.error)}"
    text.append(f"light {_color(pixel.value)}{error}, alpha {pixel.alpha:.3g}")
    for name, parts in pixel.splits.items():
        text += ["", TITLES[name], *_table(parts, most)]
    if any(part.is_rare for parts in pixel.splits.values() for part in parts):
        text += ["", "?  so rare that the samples say little: the true part may be several times larger, or smaller"]
    return text


def _table(parts: Sequence[Part], most: int) -> Iterator[str]:
    shown = [part for part in parts if part.share != 0 or part.is_rare]
    for part in shown[:most]:
        if part.is_rare:
            error = "   ?    "
        else:
            error = "        " if part.share_error is None else f" +- {100 * part.share_error:<4.1f}"
        yield f"  {100 * part.share:5.1f}{error} %  {_color(part.value):32} {part.name}"
    if len(shown) > most:
        rest = sum(part.share for part in shown[most:])
        yield f"  {100 * rest:5.1f}         %  {'':32} {len(shown) - most} more"


def _color(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
