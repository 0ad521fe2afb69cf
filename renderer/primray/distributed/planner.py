"""Planning of parts: which of a frame's samples are assigned, which range is next, and how many samples a part has. Pure.

Parts are long at first and shorter towards the end, so that all slots finish together: guided self-scheduling (Polychronopoulos
and Kuck 1987), in which each part is a share of the remaining samples. A part also costs opening its stage and building its
scene: parts are not so short that this dominates, unless slots would idle, and not so long that losing one is expensive.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..sampling.schedule import FIRST_ANCHOR
from ..settings import SAMPLE_BLOCK

Range = tuple[int, int]
MOST_AHEAD = 2  # finished parts beyond the goal to hold, for each slot: each takes the memory of a film


class AssignedRanges:
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


SHARES = 2  # remaining samples are divided by this for each slot
FEWEST, MOST = 8, 64  # samples, before their cost is known
LONGEST_S = 300.0  # sampling time of the longest part
NEWEST = 0.5  # weight of the last part in the running means


@dataclass(frozen=True)
class PartCosts:
    """Running means of the cost of parts: seconds for one sample per pixel, and seconds of overhead for each part."""

    sample_s: float | None = None
    beside_s: float = 0.0

    def seen(self, samples: int, sampling_s: float, wall_s: float) -> PartCosts:
        """Return the means with one more part."""
        each, beside = sampling_s / samples, max(wall_s - sampling_s, 0.0)
        if self.sample_s is None:
            return PartCosts(each, beside)
        return PartCosts(_running_mean(self.sample_s, each), _running_mean(self.beside_s, beside))

    def samples(self, left: int, slots: int, time_left_s: float | None = None) -> int:
        """Return the samples of the next part, a multiple of the block.

        `left`: unassigned samples; `time_left_s`: until the frame's time limit.
        """
        fewest, most = float(FEWEST), float(MOST)
        if self.sample_s is not None and self.sample_s > 0:
            fewest, most = self.beside_s / self.sample_s, LONGEST_S / self.sample_s
            if time_left_s is not None:
                most = min(most, max(time_left_s - self.beside_s, 0.0) / 2 / self.sample_s)
        share = left / max(slots, 1)
        wanted = min(max(share / SHARES, min(fewest, share)), most)
        return max(round(wanted / SAMPLE_BLOCK), 1) * SAMPLE_BLOCK


def _running_mean(before: float, now: float) -> float:
    return (1 - NEWEST) * before + NEWEST * now
