"""Size of parts: long at first, shorter towards the end, so that all slots finish together.

Guided self-scheduling (Polychronopoulos and Kuck 1987): each part is a share of the remaining samples. A part also costs
opening its stage and building its scene: parts are not so short that this dominates, unless slots would idle, and not so long
that losing one is expensive.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import SAMPLE_BLOCK

SHARES = 2  # remaining samples are divided by this for each slot
FEWEST, MOST = 8, 64  # samples, before their cost is known
LONGEST_S = 300.0  # sampling time of the longest part
NEWEST = 0.5  # weight of the last part in the running means


@dataclass(frozen=True)
class Pace:
    """Running means of the cost of parts: seconds for one sample per pixel, and seconds of overhead for each part."""

    sample_s: float | None = None
    beside_s: float = 0.0

    def seen(self, samples: int, sampling_s: float, wall_s: float) -> Pace:
        """Return the means with one more part."""
        each, beside = sampling_s / samples, max(wall_s - sampling_s, 0.0)
        if self.sample_s is None:
            return Pace(each, beside)
        return Pace(_mean(self.sample_s, each), _mean(self.beside_s, beside))

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


def _mean(before: float, now: float) -> float:
    return (1 - NEWEST) * before + NEWEST * now
