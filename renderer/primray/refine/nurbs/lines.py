"""Parameter lines of a patch's grid in one direction.

At a possible edge of the surface (a knot of full multiplicity, where tangents may differ) there are two lines at one parameter,
each with its own side's tangents; nothing is drawn between them.
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
    spans: Indices  # (M,) span of a line and of the interval after it
    starts: Flags  # (M,) first line of a smooth piece
    joined: Flags  # (M,) first line of a piece that is connected to the line before

    @property
    def is_drawn(self) -> Flags:
        """Mask of drawn intervals (M - 1,)."""
        return ~self.starts[1:]

    def split(self, intervals: Flags) -> Lines:
        """Return the lines with one more in the middle of each of the intervals (M - 1,)."""
        where = np.flatnonzero(intervals)
        return self.with_lines(where, (self.at[where] + self.at[where + 1]) / 2)

    def with_lines(self, intervals: Indices, at: Doubles) -> Lines:
        """Return the lines with further ones `at` parameters in `intervals`; both ascend."""
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
        """Return the parameters, with those at ends of pieces moved inwards by a share of the adjacent interval."""
        moved = self.at.copy()
        ends = np.append(self.starts[1:], True)
        first, last = np.flatnonzero(self.starts[:-1]), np.flatnonzero(ends)
        moved[first] += share * (self.at[first + 1] - self.at[first])
        moved[last] -= share * (self.at[last] - self.at[last - 1])
        return moved


def first_lines(direction: Direction) -> Lines:
    """Return the initial lines, enough to detect how the surface bends."""
    spans, knots = spans_of(direction), direction.knots
    parts = max(1, 2 * (direction.order - 2))
    at, span_of, starts, joined = list[float](), list[int](), list[bool](), list[bool]()
    for k in spans.tolist():
        low, high = max(float(knots[k]), direction.low), min(float(knots[k + 1]), direction.high)
        times = int(np.count_nonzero(knots == knots[k]))
        is_edge = not at or times >= direction.order - 1
        if is_edge and at:  # end of the previous piece, with its tangents
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
