"""The parameters of a patch's grid in one direction.

Where the surface may have an edge (a knot so often that tangents need not agree) the lines before and after it are two, at one
parameter, each with its own side's tangents. Between them nothing is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import Direction
from .basis import Bases, Indices, bases, spans_of

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Lines:
    direction: Direction
    at: Doubles  # (M,)
    spans: Indices  # (M,) that a line and the interval after it lie in
    starts: Flags  # (M,) the first line of a smooth piece
    joined: Flags  # (M,) that is, where the surface goes on from the line before

    @property
    def is_drawn(self) -> Flags:
        """(M - 1,) of intervals."""
        return ~self.starts[1:]

    def split(self, intervals: Flags) -> Lines:
        """With a line in the middle of each of these (M - 1,)."""
        where = np.flatnonzero(intervals)
        return self.with_lines(where, (self.at[where] + self.at[where + 1]) / 2)

    def with_lines(self, intervals: Indices, at: Doubles) -> Lines:
        """`intervals` never fall, nor does `at`."""
        place = intervals + 1
        return Lines(
            self.direction,
            np.insert(self.at, place, at),
            np.insert(self.spans, place, self.spans[intervals]),
            np.insert(self.starts, place, False),
            np.insert(self.joined, place, False),
        )

    def part(self, first: int, end: int) -> Lines:
        rows = slice(first, end)
        return Lines(self.direction, self.at[rows], self.spans[rows], self.starts[rows], self.joined[rows])

    def bases(self) -> Bases:
        return bases(self.direction, self.spans, self.at)

    def inward(self, share: float) -> Doubles:
        """The parameters moved off the ends of pieces, by this share of the interval there."""
        moved = self.at.copy()
        ends = np.append(self.starts[1:], True)
        first, last = np.flatnonzero(self.starts[:-1]), np.flatnonzero(ends)
        moved[first] += share * (self.at[first + 1] - self.at[first])
        moved[last] -= share * (self.at[last] - self.at[last - 1])
        return moved


def first_lines(direction: Direction) -> Lines:
    """As many as it takes to see how the surface bends."""
    spans, knots = spans_of(direction), direction.knots
    parts = max(1, 2 * (direction.order - 2))
    at, span_of, starts, joined = list[float](), list[int](), list[bool](), list[bool]()
    for k in spans.tolist():
        low, high = max(float(knots[k]), direction.low), min(float(knots[k + 1]), direction.high)
        times = int(np.count_nonzero(knots == knots[k]))
        is_edge = not at or times >= direction.order - 1
        if is_edge and at:  # the end of what was before, seen from there
            at.append(low)
            span_of.append(span_of[-1])
            starts.append(False)
            joined.append(False)
        for part in range(parts):
            at.append(low + (high - low) * part / parts)
            span_of.append(k)
            starts.append(is_edge and part == 0)
            joined.append(is_edge and part == 0 and len(at) > 1 and times < direction.order)
    at.append(min(float(knots[spans[-1] + 1]), direction.high))
    return Lines(
        direction,
        np.array(at),
        np.array([*span_of, span_of[-1]], np.intp),
        np.array([*starts, False]),
        np.array([*joined, False]),
    )
