"""Outliers among rendered objects: skies, grounds and stray objects that would make the rest a dot if they were framed.

They are judged by world boxes, (N, 3) low and high, and by `detail` (N,), the weight of each object.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles

Mask = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.intp]

STRAY = 10.0  # strays are this many times as far from the middle as anything nearer
MAJORITY = 2 / 3  # share of the detail that is never stray
GROUND = 4.0  # a ground is this many times as wide as all that is on it
SKY = 8.0  # a sky is this many times as wide as all that it encloses
LONE = 3.0  # factor on both if a single object would remain, which may be a small part of a large one
# Range of what a sky encloses, as shares from its middle to its sides and from its bottom to its top; objects on or in a solid
# body are often beyond it.
INNER, BELOW = 0.5, 0.75
FLAT = 0.1  # a ground's height over its width
MOST = 1000  # objects that are tested as surroundings
SAMPLED = 1 << 16  # objects by which the median is estimated
BESIDE = 0.05  # tolerance, as a share of its size, by which surroundings may miss what they surround


def outliers(low: Doubles, high: Doubles, detail: Doubles, up: int) -> Mask:
    """Return the mask (N,) of outliers, which are never all objects."""
    out = np.zeros(len(low), bool)
    for found in (strays, surroundings, strays):  # a ground hides what has strayed, and the other way round
        rest = np.flatnonzero(~out) if out.any() else slice(None)
        more = found(low[rest], high[rest], detail[rest], up)
        out[rest] = more
        if found is surroundings and not more.any():
            break
    return out


def strays(low: Doubles, high: Doubles, detail: Doubles, up: int) -> Mask:
    """Return the mask of objects far from the majority, by distance from its middle, without objects in between."""
    middle = np.array([_weighted(0.5, (low + high)[:, axis] / 2, detail) for axis in range(3)])
    above, below = high - middle, middle - low
    far = _largest(np.maximum(np.abs(above), np.abs(below)))
    near = _largest(np.maximum(-above, -below))
    reach = _weighted(MAJORITY, far, detail)
    while (farther := near[near <= STRAY * reach].max(initial=reach)) > reach:
        reach = farther
    return np.asarray((near > STRAY * reach) & (reach > 0))


def surroundings(low: Doubles, high: Doubles, detail: Doubles, up: int) -> Mask:
    """Return the mask of the widest objects that surround everything narrower: flat below it, or enclosing it."""
    across = [axis for axis in range(3) if axis != up]
    size = high - low
    wide = size[:, across].max(axis=1)
    order = _widest(wide)
    is_flat = size[order, up] <= FLAT * wide[order]
    slack = BESIDE * size[order]
    slack[is_flat, up] = np.inf
    # Row k: bounds of everything narrower than the k-th, and of the k-th and everything wider.
    around_low = _from_end(np.maximum, low[order] - slack)
    around_high = _from_end(np.minimum, high[order] + slack)
    left = len(low) - len(order) + np.arange(len(order))  # things
    holds = _from_end(np.minimum, wide[order] / np.where(is_flat, GROUND, SKY)) / np.where(left == 1, LONE, 1.0)
    inner_low, inner_high = _within(np.minimum, low, order), _within(np.maximum, high, order)
    extent = (inner_high - inner_low).max(axis=1)
    goes_around = (around_low <= inner_low).all(axis=1) & (around_high >= inner_high).all(axis=1)
    is_inside = is_flat | _is_well_inside(inner_low, inner_high, low[order], high[order], up)
    is_inside = np.logical_and.accumulate(is_inside[::-1])[::-1]
    found = goes_around & is_inside & (holds >= extent) & (extent > 0)
    out = np.zeros(len(low), bool)
    if found.any():
        out[order[np.argmax(found) :]] = True
    return out


def _is_well_inside(inner_low: Doubles, inner_high: Doubles, low: Doubles, high: Doubles, up: int) -> Mask:
    """Return whether what is enclosed is near the sky's horizontal middle and not near its top, (M,)."""
    across = [axis for axis in range(3) if axis != up]
    with np.errstate(over="ignore", invalid="ignore"):
        aside = np.abs((inner_low + inner_high) - (low + high))[:, across] <= INNER * (high - low)[:, across]
    return np.asarray(aside.all(axis=1) & (inner_high[:, up] <= low[:, up] + BELOW * (high - low)[:, up]))


def _widest(wide: Doubles) -> Ints:
    """Return the indices of at most MOST widest objects, never of all, in ascending order of width."""
    most = min(MOST, len(wide) - 1)
    chosen = np.argpartition(wide, -most)[-most:] if most > 0 else np.zeros(0, np.intp)
    return np.asarray(chosen[np.argsort(wide[chosen], kind="stable")])


def _within(combine: np.ufunc, values: Doubles, order: Ints) -> Doubles:
    """Return (M, 3): row k combines all values but those of the k-th in the order and later ones."""
    is_rest = np.ones(len(values), bool)
    is_rest[order] = False
    return np.asarray(combine.accumulate(np.vstack([combine.reduce(values[is_rest])[None], values[order]]))[:-1])


def _weighted(part: float, values: Doubles, weights: Doubles) -> float:
    """Return the weighted quantile: for a half, the median."""
    every = 1 + len(values) // SAMPLED
    values, weights = values[::every], weights[::every]
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(sums, part * sums[-1])]])


def _largest(rows: Doubles) -> Doubles:
    """Return the maximum (N,) of rows (N, 3); NumPy's own maximum along short rows takes five times as long."""
    return np.asarray(np.maximum(np.maximum(rows[:, 0], rows[:, 1]), rows[:, 2]))


def _from_end(combine: np.ufunc, values: Doubles) -> Doubles:
    return np.asarray(combine.accumulate(values[::-1])[::-1])
