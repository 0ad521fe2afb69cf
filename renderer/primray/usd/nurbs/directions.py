"""One direction of a basis from what a prim has authored of it: order, knots and range (UsdGeom NurbsPatch, NurbsCurves)."""

from __future__ import annotations

import numpy as np

from ...arrays import Doubles
from ...description import Direction


class Unfit(Exception):
    """What is authored makes no basis. `attribute` is the one to correct."""

    def __init__(self, message: str, attribute: str) -> None:
        super().__init__(message)
        self.attribute = attribute


def direction_of(
    count: int, order: int, knots: Doubles, drawn: tuple[float, float] | None, names: tuple[str, str]
) -> Direction:
    """`drawn`: the range, None for all of it; `names`: of the attributes of the order and the knots. Unfit where there is no
    basis; what of the range lies outside [knots[order - 1], knots[count]] is left out."""
    if order < 2:
        raise Unfit(f"{names[0]} is {order}, where a surface or curve needs 2.", names[0])
    if count < order:
        raise Unfit(f"{names[0]} is {order}, more than the {count} control points.", names[0])
    if len(knots) != count + order:
        raise Unfit(f"{names[1]} has {len(knots)} knots where {count + order} are needed.", names[1])
    if not np.isfinite(knots).all() or (np.diff(knots) < 0).any():
        raise Unfit(f"{names[1]} has knots that fall, or that are not finite.", names[1])
    first, last = float(knots[order - 1]), float(knots[count])
    if not first < last:
        raise Unfit(f"{names[1]} leave nothing between knots {order - 1} and {count}.", names[1])
    low, high = drawn if drawn is not None else (first, last)
    return Direction(count, order, knots, max(low, first), min(high, last))


def fits(direction: Direction) -> bool:
    """Whether something of the range is left."""
    return direction.low < direction.high


def whole(direction: Direction) -> tuple[float, float]:
    return float(direction.knots[direction.order - 1]), float(direction.knots[direction.count])
