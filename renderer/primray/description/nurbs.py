"""What a NurbsPatch is made of beside its points: one direction of its basis, and the curves that trim it."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Doubles


@dataclass(frozen=True, eq=False)
class Direction:
    """A B-spline basis of `order` (2 or more: degree + 1) over `count` control points."""

    count: int
    order: int
    knots: Doubles  # (count + order,), never falling
    low: float  # of the part of [knots[order - 1], knots[count]] that is drawn
    high: float


@dataclass(frozen=True, eq=False)
class TrimCurve:
    """A curve in the patch's parameters."""

    basis: Direction
    points: Doubles  # (count, 3), homogeneous: (u w, v w, w)


# Each loop's curves follow one another; its end is joined to its beginning.
TrimLoop = tuple[TrimCurve, ...]
