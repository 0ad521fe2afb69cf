"""Ranges of a frame's samples that are assigned, and the choice of the next one. Pure."""

from __future__ import annotations

from ..sampling.schedule import FIRST_ANCHOR
from ..settings import SAMPLE_BLOCK

Range = tuple[int, int]
MOST_AHEAD = 2  # finished parts beyond the goal to hold, for each slot: each takes the memory of a film


class Board:
    """Assigned ranges of samples, which do not overlap."""

    def __init__(self) -> None:
        self._taken: set[Range] = set()

    def take(self, part: Range) -> None:
        self._taken.add(part)

    def give_back(self, part: Range) -> None:
        """Free a range that was lost or is not wanted."""
        self._taken.remove(part)

    def across(self, goal: int) -> list[Range]:
        """Return the parts that begin before the goal and end after it: a picture of the samples up to there cannot use
        them."""
        return sorted(part for part in self._taken if part[0] < goal < part[1])

    def left(self, end: int) -> int:
        """Return how many samples below `end` are unassigned."""
        return end - sum(max(min(b, end) - a, 0) for a, b in self._taken)

    def reach(self, goal: int, expected: int | None, most: int) -> int:
        """Return the number below which samples are assigned: the goal, or beyond it once all up to there are assigned.

        Rendering ahead keeps slots busy during a measurement. `expected`: where the frame should end, if known.
        """
        return goal if self.left(goal) else min(max(2 * goal, expected or 0), most)

    def next_part(self, goal: int, end: int, samples: int) -> Range | None:
        """Return the first free range below `end`, of at most `samples` samples; None if there is none.

        It crosses neither the goal nor, beyond it, any count at which the error is always measured.
        """
        first, until = 0, end
        for a, b in sorted(self._taken):
            if a > first:
                until = min(a, end)
                break
            first = b
        if first >= end:
            return None
        bound = goal if first < goal else _next_anchor(first)
        return first, min(first + max(samples, SAMPLE_BLOCK), until, bound)


def _next_anchor(done: int) -> int:
    anchor = FIRST_ANCHOR
    while anchor <= done:
        anchor *= 2
    return anchor
