"""Which samples of a frame are rendered or under way, and which range is to be handed out next. Pure."""

from __future__ import annotations

from ..sampling.schedule import FIRST_ANCHOR
from ..settings import SAMPLE_BLOCK

Range = tuple[int, int]
MOST_AHEAD = 2  # parts for each slot that have come and lie beyond the goal: each is as large as a film


class Board:
    """Ranges that do not overlap, of samples a pixel."""

    def __init__(self) -> None:
        self._taken: set[Range] = set()

    def take(self, part: Range) -> None:
        self._taken.add(part)

    def give_back(self, part: Range) -> None:
        """It was lost, or is not wanted."""
        self._taken.remove(part)

    def across(self, goal: int) -> list[Range]:
        """Parts that begin before the goal and end behind it: a picture of all samples up to there cannot use them."""
        return sorted(part for part in self._taken if part[0] < goal < part[1])

    def left(self, end: int) -> int:
        """Samples below `end` that nobody has taken."""
        return end - sum(max(min(b, end) - a, 0) for a, b in self._taken)

    def reach(self, goal: int, expected: int | None, most: int) -> int:
        """Below which number samples are given out: the goal; beyond it once all of those are taken, so that nobody waits for
        a measurement. `expected`: where the frame should end, if that is known."""
        return goal if self.left(goal) else min(max(2 * goal, expected or 0), most)

    def next_part(self, goal: int, end: int, samples: int) -> Range | None:
        """The first that is free, of at most so many samples, below `end`; None where there is none.

        It does not cross the goal, nor, beyond it, any number at which the error is measured whatever it is.
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
