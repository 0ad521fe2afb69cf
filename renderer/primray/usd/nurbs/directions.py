"""One direction of a B-spline basis from a prim's order, knots and range (UsdGeom NurbsPatch, NurbsCurves)."""

from __future__ import annotations

import numpy as np

from ...arrays import Doubles
from ...description import Direction


class Unfit(Exception):
    """Authored values that do not make a basis. `attribute` is the one to correct."""

    def __init__(self, message: str, attribute: str) -> None:
        super().__init__(message)
        self.attribute = attribute


def direction_of(
    count: int, order: int, knots: Doubles, drawn: tuple[float, float] | None, names: tuple[str, str]
) -> Direction:
    """Return the basis with `drawn`, its range (None: all), limited to [knots[order - 1], knots[count]]. `names` are the
    attributes of order and knots. Raises Unfit where they do not make a basis."""
    if order < 2:
        raise Unfit(f"{names[0]} is {order}, but must be at least 2.", names[0])
    if count < order:
        raise Unfit(f"{names[0]} is {order}, more than the {count} control points.", names[0])
    if len(knots) != count + order:
        raise Unfit(f"{names[1]} has {len(knots)} knots where {count + order} are needed.", names[1])
    if not np.isfinite(knots).all() or (np.diff(knots) < 0).any():
        raise Unfit(f"{names[1]} has knots that decrease or are not finite.", names[1])
    first, last = float(knots[order - 1]), float(knots[count])
    if not first < last:
        raise Unfit(f"{names[1]} are equal from knot {order - 1} to knot {count}: the range is empty.", names[1])
    low, high = drawn if drawn is not None else (first, last)
    return Direction(count, order, knots, max(low, first), min(high, last))


def fits(direction: Direction) -> bool:
    """Return whether the drawn range is not empty."""
    return direction.low < direction.high


def whole(direction: Direction) -> tuple[float, float]:
    return float(direction.knots[direction.order - 1]), float(direction.knots[direction.count])
