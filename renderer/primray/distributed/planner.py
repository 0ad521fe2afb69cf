"""Planning of parts: which of a frame's samples are assigned, which range is next, and how many samples a part has. Pure.

Parts are long at first and shorter towards the end, so that all slots finish together: guided self-scheduling (Polychronopoulos
and Kuck 1987), in which each part is a share of the remaining samples. A part also costs opening its stage and building its
scene: parts are not so short that this dominates, and not so long that losing one is expensive.

`gather` and the frames in parts of the service's dispatcher are planned here.
"""

from __future__ import annotations

import hashlib
import hmac
import math
from dataclasses import dataclass, replace

from ..sampling.schedule import FIRST_ANCHOR
from ..settings import SAMPLE_BLOCK, RenderSettings
from ..settings.light_mixes import NO_MIXES

Range = tuple[int, int]
MOST_AHEAD = 2  # finished parts beyond the goal to hold, for each slot: each takes the memory of a film


def seed_of(secret: bytes, sha256: str, part: Range) -> int:
    """Return the seed of the tiles that a check draws: unknown without the secret, another one for another file."""
    return int.from_bytes(hmac.digest(secret, f"{sha256} {part[0]}:{part[1]}".encode(), hashlib.sha256), "big")


def part_settings(asked: RenderSettings, part: Range) -> RenderSettings:
    """Return the settings that one part of a frame is rendered with."""
    return replace(asked, sample_range=part, spp=None, target_error=None, time_limit_s=None, adaptive=None, **NO_MIXES)


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


SHARES = 2  # a slot's share of the remaining samples is divided by this
FEWEST = 4  # samples of any part but the last of a frame
UNMEASURED = (8.0, 64.0)  # fewest and most samples of parts whose cost is not known yet
# Sampling time that is worth a part: below, its overhead is too large a share of it. Towards the end of a frame half of it,
# where other slots would be idle.
LEAST_S = 1.0
LONGEST_S = 300.0  # sampling time of the longest part, which may be lost
NEWEST = 0.5  # weight of the last part in the running means


@dataclass(frozen=True)
class PartCosts:
    """Running means of the cost of parts: seconds for one sample per pixel, and seconds of overhead for each part."""

    sample_s: float | None = None
    overhead_s: float = 0.0

    def with_part(self, samples: int, sampling_s: float, overhead_s: float) -> PartCosts:
        """Return the means with one more part."""
        each = max(sampling_s, 1e-6) / samples
        if self.sample_s is None:
            return PartCosts(each, overhead_s)
        return PartCosts(_running_mean(self.sample_s, each), _running_mean(self.overhead_s, overhead_s))


def _running_mean(before: float, now: float) -> float:
    return (1 - NEWEST) * before + NEWEST * now


def samples_of_next_part(left: int, slots: int, costs: PartCosts, time_left_s: float | None = None) -> int:
    """Return the samples of the next part, whole blocks of them; 0 if no part would be finished in time.

    `left`: unassigned samples; `time_left_s`: until the frame's time limit.
    """
    share = left / max(slots, 1)
    (least, most), shortest = UNMEASURED, 0.0
    if costs.sample_s is not None:
        least, most = max(LEAST_S, costs.overhead_s) / costs.sample_s, LONGEST_S / costs.sample_s
        shortest = least / 2
    size = min(max(share / SHARES, min(least, share), shortest), most)
    if time_left_s is not None:
        size = _size_in_time(size, costs, time_left_s)
        shortest = min(size, shortest)
    if size <= 0:
        return 0
    samples = min(max(math.ceil(size / SAMPLE_BLOCK - 1e-9) * SAMPLE_BLOCK, FEWEST), left)
    return left if left - samples < max(FEWEST, shortest) else samples


def _size_in_time(size: float, costs: PartCosts, time_left_s: float) -> float:
    """Return the size reduced to half of what can be sampled in time; 0 if that is less than one block."""
    if time_left_s <= 0:
        return 0.0
    if costs.sample_s is None:
        return min(size, FEWEST)
    fits = (time_left_s - costs.overhead_s) / costs.sample_s
    return 0.0 if fits < SAMPLE_BLOCK else min(size, max(fits / 2, SAMPLE_BLOCK))
