"""What is read off measured points: the time to an error, and the power by which a cost grows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np


@dataclass(frozen=True)
class TimeTo:
    seconds: float
    extrapolated: bool


def time_to(points: Sequence[tuple[float, float]], error: float) -> TimeTo | None:
    """Seconds to an error from (seconds, error): logarithms interpolated; beyond either end, error times seconds is kept.

    Where a curve crosses the error more than once, the last crossing counts. None without a point whose error is above zero.
    """
    known = sorted((s, e) for s, e in points if e > 0 and s > 0)
    if not known:
        return None
    for (s0, e0), (s1, e1) in reversed(list(pairwise(known))):
        if e0 >= error >= e1 and e0 > e1:
            share = math.log(error / e0) / math.log(e1 / e0)
            return TimeTo(s0 * (s1 / s0) ** share, False)
    nearest = known[0] if error > known[0][1] else known[-1]
    return TimeTo(nearest[0] * nearest[1] / error, True)


@dataclass(frozen=True)
class Growth:
    """cost = fixed + each * count ^ power."""

    fixed: float
    each: float
    power: float
    residual: float  # root mean square of the relative deviations

    def at(self, count: float) -> float:
        return self.fixed + self.each * count**self.power


POWERS = np.linspace(0.0, 2.5, 501)


def growth(counts: Sequence[float], costs: Sequence[float]) -> Growth:
    """The best such law by relative deviations, neither term negative; of four points at least, as three fit exactly."""
    n, cost = np.asarray(counts, float), np.asarray(costs, float)
    if len(n) < 4 or (cost <= 0).any():
        raise ValueError("growth needs four costs above zero")
    best: Growth | None = None
    scale = n.max()  # so that powers of it stay near 1
    for power in POWERS:
        columns = np.stack([1 / cost, (n / scale) ** power / cost], axis=1)
        for use in ((0, 1), (1,), (0,)):
            weights = np.zeros(2)
            weights[list(use)] = np.linalg.lstsq(columns[:, use], np.ones(len(n)), rcond=None)[0]
            if (weights < 0).any():
                continue
            residual = float(np.sqrt(np.mean((columns @ weights - 1) ** 2)))
            if best is None or residual < best.residual - 1e-9:
                best = Growth(float(weights[0]), float(weights[1] / scale**power), float(power), residual)
            break
    assert best is not None
    return best


def power_of_n_log_n(counts: Sequence[float]) -> float:
    """The power that n log n looks like between the first and the last count."""
    first, last = min(counts), max(counts)
    if first <= 1 or first == last:
        return 1.0
    return 1 + math.log(math.log(last) / math.log(first)) / math.log(last / first)
