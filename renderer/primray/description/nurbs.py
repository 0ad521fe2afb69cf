"""Parts of a NurbsPatch: one direction of its basis, and its trim curves."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Doubles


@dataclass(frozen=True, eq=False)
class Direction:
    """B-spline basis of `order` (at least 2: degree + 1) over `count` control points."""

    count: int
    order: int
    knots: Doubles  # (count + order,), not decreasing
    low: float  # start of the drawn part of [knots[order - 1], knots[count]]
    high: float


@dataclass(frozen=True, eq=False)
class TrimCurve:
    """Curve in the parameters of a patch."""

    basis: Direction
    points: Doubles  # (count, 3), homogeneous: (u w, v w, w)


# Loop of curves, each of which begins where the last one ends; its end is joined to its beginning.
TrimLoop = tuple[TrimCurve, ...]
