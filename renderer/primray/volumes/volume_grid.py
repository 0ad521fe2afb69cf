"""A sparse voxel grid in memory: leaves of 8^3 voxels, tiles of one value, and a background everywhere else.

Voxel centres are at integer coordinates of index space. Values are what the file has: those that are not finite or are negative
are counted, for whoever uses the grid to report them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats, Ints

LEAF, VOXELS = 8, 512
_ROOT_BITS = 12  # a node of the root has 4096^3 voxels
_LOWEST, _HIGHEST = -(1 << 31), (1 << 31) - 1
LEVEL_SET, FOG_VOLUME = "level set", "fog volume"

Int64s = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class VolumeGrid:
    """A grid of numbers, or of vectors of three.

    `leaf_values` are half precision where the file's are, else single precision, to which double precision and integers are
    rounded (bools are 0 and 1). Half precision holds a leaf's inactive values rounded likewise, `background` does not.
    Offset 64 x + 8 y + z of a leaf is the voxel (x, y, z) from its origin. Leaves and tiles do not overlap.
    """

    name: str
    grid_class: (
        str  # LEVEL_SET: signed distances; FOG_VOLUME, "staggered" or "unknown": densities, temperatures, velocities, ...
    )
    field_from_index: Doubles  # (4, 4), for column vectors: index space to the space of the prim that names the file
    background: Floats  # () or (3,)
    leaf_origins: Ints  # (n, 3), the first voxel, a multiple of 8
    leaf_values: npt.NDArray[np.float16] | Floats  # (n, 512) or (n, 512, 3)
    tile_origins: Ints  # (m, 3), the first voxel
    tile_sizes: Ints  # (m,), 8, 128 or 4096 voxels along an edge
    tile_values: Floats  # (m,) or (m, 3)
    bounds: Ints | None  # (2, 3): the first and last active voxels along each axis; None where no voxel is active
    active_voxels: int  # including those in active tiles
    nonfinite: int  # leaf voxels, tiles and backgrounds that are infinite or not a number
    negative: int  # leaf voxels, tiles and backgrounds with a number below 0

    @property
    def width(self) -> int:
        """How many numbers a value has: 1 or 3."""
        return 3 if self.background.ndim else 1

    @property
    def nbytes(self) -> int:
        return self.leaf_values.nbytes + self.leaf_origins.nbytes + self.tile_values.nbytes + self.tile_origins.nbytes

    @cached_property
    def support(self) -> Doubles | None:
        """The box (2, 3) in index space outside of which interpolation gives 0, for a background of 0; None: all is 0."""
        bits = self.leaf_values.view(np.uint16 if self.leaf_values.itemsize == 2 else np.uint32)  # faster than numbers
        leaves = self.leaf_origins[bits.any(axis=tuple(range(1, bits.ndim)))]
        tiles = self.tile_values.reshape(len(self.tile_values), self.width).any(axis=1)
        origins = np.concatenate([leaves, self.tile_origins[tiles]]).astype(np.float64)
        if not len(origins):
            return None
        sizes = np.concatenate([np.full(len(leaves), LEAF), self.tile_sizes[tiles]])
        return np.array([origins.min(axis=0) - 1, (origins + sizes[:, None]).max(axis=0)])

    def values_at(self, voxels: npt.NDArray[Any]) -> Floats:
        """Return the values (n,) or (n, 3) of voxels (n, 3)."""
        voxels = voxels.astype(np.int64)
        found = np.empty((len(voxels), *self.background.shape), np.float32)
        found[:] = self.background
        for places in self._tiles:
            at, there = places.find(voxels)
            found[there] = self.tile_values[at]
        at, there = self._leaves.find(voxels)
        x, y, z = (voxels[there] & (LEAF - 1)).T
        found[there] = self.leaf_values[at, (x * LEAF + y) * LEAF + z]
        return found

    def values_of_leaves(self, origins: npt.NDArray[Any]) -> Floats:
        """Return the values (n, 512) or (n, 512, 3) of leaves by their first voxels (n, 3), multiples of 8."""
        origins = origins.astype(np.int64)
        found = np.empty((len(origins), VOXELS, *self.background.shape), np.float32)
        found[:] = self.background
        for places in self._tiles:
            at, there = places.find(origins)
            found[there] = self.tile_values[at, None]
        at, there = self._leaves.find(origins)
        found[there] = self.leaf_values[at]
        return found

    def sample(self, points: Doubles) -> Doubles:
        """Return trilinearly interpolated values (n,) or (n, 3) at points (n, 3) of index space."""
        points = np.asarray(points, np.float64)
        # A coordinate that is not a number is not inside.
        inside: npt.NDArray[np.bool_] = np.all((points >= _LOWEST) & (points < _HIGHEST), axis=1)
        within = np.where(inside[:, None], points, _LOWEST)
        first = np.floor(within).astype(np.int64)
        part = within - first
        total = np.zeros((len(points), *self.background.shape))
        for corner in np.ndindex(2, 2, 2):
            weight = np.where(corner, part, 1 - part).prod(1)
            values = self.values_at(first + np.array(corner)).astype(np.float64)
            # A neighbour of weight 0 has no effect, even if it is infinite.
            values[weight == 0] = 0
            total += values * weight.reshape(-1, *[1] * self.background.ndim)
        total[~inside] = self.background
        return total

    @cached_property
    def _leaves(self) -> _Places:
        return _Places(self.leaf_origins, LEAF)

    @cached_property
    def _tiles(self) -> list[_Places]:
        sizes = sorted(set(self.tile_sizes.tolist()))
        return [_Places(self.tile_origins, size, np.flatnonzero(self.tile_sizes == size)) for size in sizes]


class _Places:
    """Cubes of one size, found by the voxels in them."""

    def __init__(self, origins: Ints, size: int, rows: Int64s | None = None) -> None:
        self._bits = size.bit_length() - 1
        rows = np.arange(len(origins)) if rows is None else rows
        own = origins[rows].astype(np.int64)
        self._roots = np.unique(_root_keys(own))
        keys = self._keys(own, np.searchsorted(self._roots, _root_keys(own)))
        order = np.argsort(keys)
        self._sorted, self._rows = keys[order], rows[order]

    def _keys(self, voxels: Int64s, root: Int64s) -> Int64s:
        x, y, z = ((voxels & ((1 << _ROOT_BITS) - 1)) >> self._bits).T
        found: Int64s = (((root << 9 | x) << 9) | y) << 9 | z
        return found

    def find(self, voxels: Int64s) -> tuple[Int64s, npt.NDArray[np.bool_]]:
        """Return the rows of the cubes that voxels are in, for those that are in one, and which of the voxels these are."""
        if not len(self._sorted):
            return np.empty(0, np.int64), np.zeros(len(voxels), np.bool_)
        wanted = _root_keys(voxels)
        root = np.searchsorted(self._roots, wanted).clip(max=len(self._roots) - 1)
        keys = self._keys(voxels, root)
        at = np.searchsorted(self._sorted, keys).clip(max=len(self._sorted) - 1)
        there = (self._roots[root] == wanted) & (self._sorted[at] == keys)
        return self._rows[at[there]], there


def _root_keys(voxels: Int64s) -> Int64s:
    """Return one number for each node of the root; coordinates have 32 bits, so that 21 are left for each."""
    x, y, z = ((voxels >> _ROOT_BITS) + (1 << 20)).T
    found: Int64s = ((x << 21) | y) << 21 | z
    return found
