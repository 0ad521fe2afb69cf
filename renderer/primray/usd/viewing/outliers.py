"""What is drawn but would make the rest a dot, were it framed: skies, grounds and things that have strayed far away.

Judged by boxes in the world, (N, 3) low and high, and by `detail` (N,), what each of them counts.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles

Mask = npt.NDArray[np.bool_]

STRAY = 10.0  # times as far from the middle as all that is nearer
MAJORITY = 0.75  # of the detail, that those which are nearer have at least
GROUND = 4.0  # times as wide as all that stands on it
SKY = 8.0  # times as wide as all that it encloses
FLAT = 0.1  # a ground's height over its width
BESIDE = 0.05  # of its width: by so much a surrounding may miss what it surrounds


def outliers(low: Doubles, high: Doubles, detail: Doubles, up: int) -> Mask:
    """Never all of them."""
    out = np.zeros(len(low), bool)
    for _ in range(2):  # what strays may hide a ground, and the other way round
        for found in (strays, lambda lo, hi, d: surroundings(lo, hi, up)):
            rest = np.flatnonzero(~out)
            out[rest[found(low[rest], high[rest], detail[rest])]] = True
    return out


def strays(low: Doubles, high: Doubles, detail: Doubles) -> Mask:
    """What reaches far beyond the majority: past a gap, in its distance from the middle."""
    middle = np.array([_weighted_median((low + high)[:, axis] / 2, detail) for axis in range(3)])
    far = np.maximum(np.abs(low - middle), np.abs(high - middle)).max(axis=1)
    order = np.argsort(far, kind="stable")
    far, within = far[order], np.cumsum(detail[order])
    is_gap = (far[1:] > STRAY * far[:-1]) & (far[:-1] > 0) & (within[:-1] >= MAJORITY * within[-1])
    out = np.zeros(len(low), bool)
    if is_gap.any():
        out[order[np.argmax(is_gap) + 1 :]] = True
    return out


def surroundings(low: Doubles, high: Doubles, up: int) -> Mask:
    """The widest ones, where each of them goes all around what is not so wide: flat below it, or enclosing it."""
    across = [axis for axis in range(3) if axis != up]
    size = high - low
    wide = size[:, across].max(axis=1)
    order = np.argsort(wide, kind="stable")
    low, high, size, wide = low[order], high[order], size[order], wide[order]
    is_flat = size[:, up] <= FLAT * wide
    slack = BESIDE * wide[:, None]
    far_low, far_high = low - slack, high + slack
    far_low[is_flat, up], far_high[is_flat, up] = -np.inf, np.inf
    # Row k: of the first k + 1, and of all that are wider.
    inner_low, inner_high = np.minimum.accumulate(low)[:-1], np.maximum.accumulate(high)[:-1]
    outer_low, outer_high = _from_end(np.maximum, far_low)[1:], _from_end(np.minimum, far_high)[1:]
    reach = _from_end(np.minimum, wide / np.where(is_flat, GROUND, SKY))[1:]
    inner = (inner_high - inner_low).max(axis=1)
    goes_around = (outer_low <= inner_low).all(axis=1) & (outer_high >= inner_high).all(axis=1) & (reach >= inner)
    out = np.zeros(len(low), bool)
    if (goes_around & (inner > 0)).any():
        out[order[np.argmax(goes_around & (inner > 0)) + 1 :]] = True
    return out


def _weighted_median(values: Doubles, weights: Doubles) -> float:
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(sums, sums[-1] / 2)]])


def _from_end(combine: np.ufunc, values: Doubles) -> Doubles:
    return np.asarray(combine.accumulate(values[::-1])[::-1])
