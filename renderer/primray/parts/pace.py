"""How many samples a part should have: long at first, shorter towards the end, so that all slots end together.

Guided self-scheduling (Polychronopoulos and Kuck 1987): each part is a share of what is left. A part costs more than its
samples, since its stage is opened and its scene built: none is so short that this would be most of it, unless slots would be
idle for that. None is so long that losing it would be much.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import SAMPLE_BLOCK

SHARES = 2  # of what is left, so many parts for each slot
FEWEST, MOST = 8, 64  # samples, before it is known what they take
LONGEST_S = 300.0  # of sampling
NEWEST = 0.5  # the weight of the last part in what is known


@dataclass(frozen=True)
class Pace:
    """What parts have taken: seconds of sampling for a sample a pixel, and seconds beside that for a part."""

    sample_s: float | None = None
    beside_s: float = 0.0

    def seen(self, samples: int, sampling_s: float, wall_s: float) -> Pace:
        """With one more part."""
        each, beside = sampling_s / samples, max(wall_s - sampling_s, 0.0)
        if self.sample_s is None:
            return Pace(each, beside)
        return Pace(_mean(self.sample_s, each), _mean(self.beside_s, beside))

    def samples(self, left: int, slots: int, time_left_s: float | None = None) -> int:
        """Of the next part, in blocks. `left`: that nobody has taken; `time_left_s`: of the frame's time limit."""
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
