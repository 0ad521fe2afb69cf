"""Choice of sample times for a path, such that the path between samples is within a bound of USD's.

Times are fractions of the exposure's span. A path may bend at authored samples; samples on the line between others are left
out. Each remaining interval is divided into equal parts until the error is small enough.

Paths may jump, as with value clips, held values and splines. A description has no jumps and the core's times are single
precision, so a jump is made within a fraction JUMP of the span, ending at the time of the jump.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ...description import MotionSteps

MOST_SEGMENTS = 128
MOST_UNIFORM = 32  # equal segments are faster to look up: up to this many are made for that
# Probed fractions of a segment, chosen so that whole turns cannot hide between them.
PROBED_FIRST = (0.5, 0.2113, 0.7887, 0.1127, 0.3871, 0.6306, 0.9039)
PROBED = (0.5, 0.2113, 0.7887)
SAME_TIME = 1e-9
JUMP = 2.0**-22  # of the span: a few units in the last place of times near 1
JUMP_NO_ERROR = 1e-3  # pixels
FEW = 8  # parts; below, the number is at most doubled, which suffices for turns

Error = Callable[[float, float, float], float]  # error at the third time of a path linear between the first two


@dataclass(frozen=True)
class Steps:
    times: tuple[float, ...]  # ascending from 0 to 1
    error: float  # largest remaining error
    by_error: bool = False  # more segments than the authored samples need

    @property
    def segments(self) -> int:
        return len(self.times) - 1

    def of(self, path: str, kind: str, rounding: float = 0.0) -> MotionSteps:
        """Return the report entry; errors up to `rounding` pixels, from the precision of numbers, count as 0."""
        return MotionSteps(path, kind, self.segments, self.by_error, self.error if self.error > rounding else 0.0)


def sample_times(error: Error, bends: Sequence[float], most: float, none: float, limit: int = MOST_SEGMENTS) -> Steps:
    """Return the fewest times that keep `error` below `most`; a sample is left out if the path stays within `none` without it.

    There are at most `limit` segments, unless there are more authored samples.
    """
    kept = _kept_times(error, [0.0, *_bends_inside(error, bends, max(none, JUMP_NO_ERROR)), 1.0], none)
    needed = [_needed_parts(error, a, b, most, limit) for a, b in itertools.pairwise(kept)]
    counts = _within_limit([count for count, _ in needed], limit)
    times = _uniform_times(kept, counts, limit) or _divided_times(kept, counts)
    left = max(left for _, left in needed) if counts == [count for count, _ in needed] else _largest(error, times)
    return Steps(tuple(times), left, any(count > 1 for count, _ in needed))


def _bends_inside(error: Error, bends: Sequence[float], none: float) -> list[float]:
    """Return the times between 0 and 1, without duplicates; where the path jumps, also the start of the jump."""
    found: list[float] = []
    for cluster in _clusters(time for time in sorted(bends) if -JUMP < time < 1.0 + JUMP):
        if cluster[-1] < JUMP:
            found += [JUMP] if _jumps(error, JUMP, none) else []
        elif cluster[-1] > 1.0 - JUMP:
            found += [1.0 - JUMP] if _jumps(error, 1.0, none) else []
        elif len(cluster) > 1 and _jumps(error, cluster[-1], none):
            found += [cluster[-1] - JUMP, cluster[-1]]
        else:
            found.append(cluster[0])
    return found


def _clusters(times: Iterable[float]) -> Iterator[list[float]]:
    """Yield ascending times, grouped where they are too close to tell apart."""
    cluster: list[float] = []
    for time in times:
        if cluster and time - cluster[-1] > 1.5 * JUMP:
            yield cluster
            cluster = []
        cluster.append(time)
    if cluster:
        yield cluster


def _jumps(error: Error, end: float, none: float) -> bool:
    """Return whether the path jumps within JUMP before this time; a path that does not is nearly straight over twice that
    interval."""
    if end < 2.0 * JUMP:  # times before the span are never seen
        return error(end - JUMP, end + JUMP, end) > none
    return error(end - 2.0 * JUMP, end, end - JUMP) > none


def _kept_times(error: Error, times: list[float], none: float) -> list[float]:
    kept, start = [times[0]], 0
    for end in range(2, len(times)):
        between = (times[k] for k in range(start + 1, end))
        if any(not error(times[start], times[end], time) <= none for time in between):
            start = end - 1
            kept.append(times[start])
    return [*kept, times[-1]]


def _needed_parts(error: Error, start: float, end: float, most: float, limit: int) -> tuple[int, float]:
    """Return the number of equal parts, and the remaining error, which falls with the square of that number for smooth
    paths."""
    count = 1
    if _is_jump(start, end):
        return 1, 0.0
    while True:
        probed = PROBED_FIRST if count == 1 else PROBED
        edges = [start + (end - start) * k / count for k in range(count)] + [end]
        left = max(error(a, b, a + (b - a) * u) for a, b in itertools.pairwise(edges) for u in probed)
        if left <= most or count >= limit:
            return count, left
        by_square = math.ceil(count * math.sqrt(left / most)) if math.isfinite(left) else 2 * count
        count = min(max(count + 1, min(by_square, 2 * count if count < FEW else 4 * count)), limit)


def _within_limit(counts: list[int], limit: int) -> list[int]:
    total = sum(counts)
    if total <= limit:
        return counts
    return [max(1, count * limit // total) for count in counts]


def _uniform_times(kept: list[float], counts: list[int], limit: int) -> list[float] | None:
    """Return equal segments over the whole span if the kept samples allow that with few of them, else None."""
    for grid in range(1, MOST_UNIFORM + 1):
        if all(abs(time * grid - round(time * grid)) < SAME_TIME * grid for time in kept):
            lengths = [round(b * grid) - round(a * grid) for a, b in itertools.pairwise(kept)]
            total = grid * max(math.ceil(count / length) for count, length in zip(counts, lengths, strict=True))
            exact = {round(time * total): time for time in kept}
            few = total <= max(MOST_UNIFORM, sum(counts)) and total <= limit
            return [exact.get(k, k / total) for k in range(total + 1)] if few else None
    return None


def _divided_times(kept: list[float], counts: list[int]) -> list[float]:
    times = [a + (b - a) * k / n for a, b, n in zip(kept, kept[1:], counts, strict=False) for k in range(n)]
    return [*times, 1.0]


def _largest(error: Error, times: Sequence[float]) -> float:
    segments = [(a, b) for a, b in itertools.pairwise(times) if not _is_jump(a, b)]
    return max(error(a, b, a + (b - a) * u) for a, b in segments for u in PROBED)


def _is_jump(start: float, end: float) -> bool:
    return end - start < 1.5 * JUMP


def fractions(offsets: Sequence[float], span: tuple[float, float], blur_scale: float) -> list[float]:
    """Return fractions of the span for offsets from the frame at which a prim's path bends, given its motion:blurScale."""
    first, last = span
    if blur_scale == 0.0 or last == first:
        return []
    return [(offset / blur_scale - first) / (last - first) for offset in offsets]


def corners_of(low: Doubles, high: Doubles) -> Doubles:
    """Return the corners (8, 3) of a box."""
    return np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
