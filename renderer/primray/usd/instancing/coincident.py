"""Removal of instances that exactly coincide with another one: each of them would have to be tested by rays through that place.

Ten thousand coincident instances cost Embree a millisecond per ray. The image is the same: a ray hits one of several coincident
surfaces and continues beyond all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ...description.placement import Instances, PointInstances

# A few coincident instances cost nothing, while looking for them in many small placements would.
FEWEST_INSTANCES = 32
# Larger placements are first tested by this many random instances, which reveal crowds that matter (some 1000 of 10 million).
SAMPLE = 1 << 16

Words = npt.NDArray[np.uint64]


def without_coincident(level: Instances) -> Instances:
    """Return the instances without exact duplicates in matrix (or position, orientation and scale) and primvars; the first of
    each is kept."""
    count = len(level)
    if count < FEWEST_INSTANCES:
        return level
    columns = _columns(level)
    if count > SAMPLE:
        chosen = np.random.default_rng(0).integers(0, count, SAMPLE)
        chosen = np.unique(chosen)  # drawn with replacement
        if len(_repeated_rows([c[chosen] for c in columns])) == 0:
            return level
    repeated = _repeated_rows(columns)
    if len(repeated) == 0:
        return level
    keep = np.ones(count, np.bool_)
    keep[repeated] = False
    return level.take(keep)


def _columns(level: Instances) -> list[npt.NDArray[Any]]:
    """Return arrays (K, n) whose rows together identify an instance."""
    if isinstance(level, PointInstances):
        own = [level.positions, level.orientations, level.scales]
    else:
        own = [level.matrices.reshape(len(level), 12)]
    return [c for c in own if c is not None] + [p.values.reshape(len(level), -1) for p in level.primvars]


def _repeated_rows(columns: list[npt.NDArray[Any]]) -> npt.NDArray[np.int64]:
    """Return the rows equal to an earlier one; some may be missed if different rows have the same hash."""
    hashes = _row_hashes(columns)
    order = np.argsort(hashes, kind="stable")
    again = np.flatnonzero(hashes[order[1:]] == hashes[order[:-1]])
    earlier, later = order[again], order[again + 1]
    same = np.ones(len(again), np.bool_)
    for column in columns:
        same &= np.asarray((column[earlier] == column[later]).all(axis=1))
    return np.asarray(later[same])


def _row_hashes(columns: list[npt.NDArray[Any]]) -> Words:
    """Return a 64-bit hash per row, equal for equal rows (0 and -0 count as equal)."""
    total = np.zeros(len(columns[0]), np.uint64)
    for column in columns:
        for k in range(column.shape[1]):
            # Half of the finalizer of MurmurHash3's 64-bit mix, after each number.
            total ^= (column[:, k].astype(np.float64) + 0.0).view(np.uint64)
            total *= np.uint64(0xFF51AFD7ED558CCD)
            total ^= total >> np.uint64(33)
    return total
