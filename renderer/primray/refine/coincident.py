"""Instances that stand exactly where another does, left out: a ray there would have to be tested against each of them.

Ten thousand in one place cost Embree a millisecond a ray. What is left shows the same: of surfaces in one place a ray meets
one, and goes on beyond all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..description.placement import Instances, PointInstances

# A few instances in one place cost nothing, looking for them in many small placements would.
FEWEST = 32
# Of more instances only as many are looked at first, at random: crowds that matter (some 1000 of 10 million) show in them.
SAMPLE = 1 << 16

Words = npt.NDArray[np.uint64]


def distinct(level: Instances) -> Instances:
    """Without exact repetitions of matrix (or position, orientation and scale) and primvars; the first of each stays."""
    count = len(level)
    if count < FEWEST:
        return level
    columns = _columns(level)
    if count > SAMPLE:
        chosen = np.random.default_rng(0).integers(0, count, SAMPLE)
        chosen = np.unique(chosen)  # with repetitions, as chance has it
        if len(_repeated([c[chosen] for c in columns])) == 0:
            return level
    repeated = _repeated(columns)
    if len(repeated) == 0:
        return level
    keep = np.ones(count, np.bool_)
    keep[repeated] = False
    return level.take(keep)


def _columns(level: Instances) -> list[npt.NDArray[Any]]:
    """(K, n) arrays whose rows together say all of an instance."""
    if isinstance(level, PointInstances):
        own = [level.positions, level.orientations, level.scales]
    else:
        own = [level.matrices.reshape(len(level), 12)]
    return [c for c in own if c is not None] + [p.values.reshape(len(level), -1) for p in level.primvars]


def _repeated(columns: list[npt.NDArray[Any]]) -> npt.NDArray[np.int64]:
    """Rows that say the same as an earlier one. Where two different ones have one hash, some may stay."""
    hashes = _hashes(columns)
    order = np.argsort(hashes, kind="stable")
    again = np.flatnonzero(hashes[order[1:]] == hashes[order[:-1]])
    earlier, later = order[again], order[again + 1]
    same = np.ones(len(again), np.bool_)
    for column in columns:
        same &= np.asarray((column[earlier] == column[later]).all(axis=1))
    return np.asarray(later[same])


def _hashes(columns: list[npt.NDArray[Any]]) -> Words:
    """64 bits a row, the same for equal rows (also for 0 and -0)."""
    total = np.zeros(len(columns[0]), np.uint64)
    for column in columns:
        for k in range(column.shape[1]):
            # The finalizer of MurmurHash3's 64 bit mix, half of it, after each number.
            total ^= (column[:, k].astype(np.float64) + 0.0).view(np.uint64)
            total *= np.uint64(0xFF51AFD7ED558CCD)
            total ^= total >> np.uint64(33)
    return total
