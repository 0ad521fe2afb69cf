"""Blur of volumes by a field of velocities: velocities at the voxels of what is blurred, and as far as they carry it.

A grid of values f at the frame's time is f(x - v (t - frame)) at time t, with the velocity v at x (Kim and Ko 2007, "Eulerian
Motion Blur"): other renderers do the same with the files of simulations, whose velocities are per second, in the space of the
field. Where nothing is and nothing moves, the velocities nearby are extended, so that what leaves its place has a velocity
where it arrives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats, Ints
from ...description.volumes import VelocityBlur
from ...process_memory import machine_bytes
from ...volumes.volume_grid import LEAF, VOXELS, VolumeGrid
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..scene.schemas import VELOCITY_SCALES
from ..stage.metadata import time_codes_per_second
from ..stage.values import read
from .baking import TooLargeError, domain_of, shares_space
from .fields import VELOCITY_NAMES, Field, field_named
from .motion import move_together

_ROWS = 1 << 10  # leaves at a time
_MARGIN = 1  # voxels around a leaf that interpolation reaches
_WIDEST = 1 << 20  # voxels; coordinates of coarser and coarser cubes are found up to this size
_VOXELS_OF_LEAF = np.stack(np.meshgrid(*[np.arange(LEAF)] * 3, indexing="ij"), axis=-1).reshape(VOXELS, 3)
_AROUND = np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3, indexing="ij"), axis=-1).reshape(27, 3)

Int64s = npt.NDArray[np.int64]


class TooFarError(Exception):
    """Velocities that would need too many voxels; the message says how many."""


@dataclass(frozen=True, eq=False)
class Velocities:
    """The velocities of a Volume, and the exposure over which they blur it."""

    field: Field
    names: tuple[str, ...]  # of the Volume's fields that it is, or whose components it has
    scale: float  # of the velocities
    span: tuple[float, float]  # time codes from the frame
    per_second: float  # time codes
    limit: int  # bytes of one grid of velocities

    @property
    def frame(self) -> float:
        """The frame's time, as a fraction of the span."""
        first, last = self.span
        return -first / (last - first)

    def blur_of(self, base: Field, grids: Sequence[VolumeGrid]) -> VelocityBlur | None:
        """Return the blur of grids in the index space of `base`; None where nothing moves. Raise TooFarError."""
        source = _Source(self, base, grids)
        leaves = source.leaves()
        if not len(leaves):
            return None
        reached = self._reached(source, leaves)
        values, known = np.zeros((len(reached), VOXELS, 3), np.float32), np.zeros((len(reached), VOXELS), np.bool_)
        for start in range(0, len(reached), _ROWS):
            rows = slice(start, start + _ROWS)
            values[rows] = source.velocities(reached[rows])
            known[rows] = values[rows].any(axis=2) | source.is_there(reached[rows])
        if not values.any():
            return None
        _extend(reached, values, known)
        return VelocityBlur(velocity=_grid_of(reached, values, base.grid), frame=self.frame)

    def _reached(self, source: _Source, leaves: Ints) -> Ints:
        """Return the leaves (K, 3) that what is in leaves reaches over the span, by their first voxels."""
        times = np.array([-self.frame, 1 - self.frame])
        found: list[Int64s] = []
        most = self.limit // (VOXELS * 3 * 4)
        total = 0
        for start in range(0, len(leaves), _ROWS):
            own = leaves[start : start + _ROWS].astype(np.int64)
            velocities = source.velocities(own)
            ends = np.stack([velocities.min(axis=1), velocities.max(axis=1)])[:, None] * times[:, None, None]
            low, high = np.minimum(ends.min(axis=(0, 1)), 0.0), np.maximum(ends.max(axis=(0, 1)), 0.0)
            first = np.floor((own + low - 2 * _MARGIN) / LEAF).astype(np.int64)
            count = np.floor((own + LEAF - 1 + high + 2 * _MARGIN) / LEAF).astype(np.int64) - first + 1
            each = count.prod(axis=1)
            total += int(each.sum())
            if total > 64 * most:
                raise TooFarError(f"they carry it over {total:,} blocks of {VOXELS} voxels and more")
            rows = np.repeat(np.arange(len(own)), each)
            at = np.arange(len(rows)) - np.repeat(np.cumsum(each) - each, each)
            _, y, z = count[rows].T
            found.append(np.unique(first[rows] + np.stack([at // (y * z), at // z % y, at % z], axis=1), axis=0))
        places = np.unique(np.concatenate(found), axis=0)
        if len(places) > most:
            raise TooFarError(f"they carry it over {len(places):,} blocks of {VOXELS} voxels; {most:,} are allowed")
        return (places * LEAF).astype(np.int32)


class _Source:
    """Velocities in the index space of what they blur, in voxels per span, and where something is."""

    def __init__(self, of: Velocities, base: Field, grids: Sequence[VolumeGrid]) -> None:
        self._grid, self._grids = of.field.grid, grids
        group_from_field = of.field.group_from_index @ np.linalg.inv(of.field.grid.field_from_index)
        index_from_group = np.linalg.inv(base.group_from_index)
        seconds = (of.span[1] - of.span[0]) / of.per_second * of.scale
        self._turn = (index_from_group @ group_from_field)[:3, :3] * seconds
        self._index_from_base = np.linalg.inv(of.field.group_from_index) @ base.group_from_index
        self._is_same = bool(np.allclose(self._index_from_base, np.eye(4), rtol=0.0, atol=1e-9))
        self._limit = of.limit

    def leaves(self) -> Ints:
        """Return the leaves of all grids, of which tiles are some, by their first voxels."""
        found = [grid.leaf_origins[grid.leaf_values.any(axis=tuple(range(1, grid.leaf_values.ndim)))] for grid in self._grids]
        for grid in self._grids:
            sizes = grid.tile_sizes.astype(np.int64)
            if (count := int(((sizes // LEAF) ** 3).sum())) > self._limit // (VOXELS * 3 * 4):
                raise TooFarError(f"its tiles have {count:,} blocks of {VOXELS} voxels")
            for origin, size in zip(grid.tile_origins, sizes.tolist(), strict=True):
                steps = np.arange(0, size, LEAF)
                found.append(origin + np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3))
        return np.unique(np.concatenate(found), axis=0)

    def velocities(self, leaves: npt.NDArray[np.integer[Any]]) -> Floats:
        """Return the velocities (n, 512, 3) at the voxels of leaves (n, 3)."""
        if self._is_same:
            found: npt.NDArray[np.floating[Any]] = self._grid.values_of_leaves(leaves)
        else:
            voxels = (leaves[:, None, :].astype(np.int64) + _VOXELS_OF_LEAF).reshape(-1, 3)
            found = self._grid.sample(voxels @ self._index_from_base[:3, :3].T + self._index_from_base[:3, 3])
        return (found.reshape(-1, 3) @ self._turn.T).astype(np.float32).reshape(-1, VOXELS, 3)

    def is_there(self, leaves: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.bool_]:
        """Return whether some grid is not 0 at the voxels of leaves (n, 3)."""
        found = np.zeros((len(leaves), VOXELS), np.bool_)
        for grid in self._grids:
            found |= (grid.values_of_leaves(leaves) != 0).reshape(len(leaves), VOXELS, -1).any(axis=2)
        return found


def velocities_of(volume: ResolvedPrim, fields: dict[str, Field], ctx: Context) -> Velocities | None:
    """Return the velocities that blur a Volume; None where there are none, or no time passes."""
    if not ctx.timing.is_open:
        return None
    scale = volume.inherited.blur_scale
    for name in VELOCITY_SCALES:
        if name in volume.names and isinstance(factor := read(volume.prim, name, ctx.when), int | float):
            scale *= float(factor)
            break
    if scale == 0.0 or not np.isfinite(scale):
        return None
    limit = ctx.settings.max_memory_bytes or machine_bytes() // 8
    found = next((field for name in VELOCITY_NAMES if (field := field_named(fields, name)) is not None), None)
    names: tuple[str, ...] = () if found is None else (found.name,)
    if found is None:
        found, names = _of_components(volume, fields, limit, ctx)
    if found is None:
        return None
    if found.grid.width != 3:
        message = f"The field {found.name} has one number a voxel: velocities have three, and the volume is not blurred by it."
        ctx.warn("motion", volume.path, message)
        return None
    return Velocities(found, names, scale, ctx.timing.span, time_codes_per_second(ctx.stage), limit)


def _of_components(
    volume: ResolvedPrim, fields: dict[str, Field], limit: int, ctx: Context
) -> tuple[Field | None, tuple[str, ...]]:
    """Return the velocities whose components are three fields of one number a voxel, and their names; None where there are
    none. Components that cannot be joined are reported."""
    found: dict[str, dict[int, Field]] = {}
    for field in fields.values():
        if (component := field.component) is not None:
            found.setdefault(component[0], {}).setdefault(component[1], field)
    name = max(found, key=lambda name: (len(found[name]), -VELOCITY_NAMES.index(name)), default="")
    parts = [found[name][axis] for axis in sorted(found[name])] if name else []
    if not parts:
        return None, ()
    names = tuple(part.name for part in parts)
    try:
        return _joined(parts, limit, ctx), names
    except (UnlikePartsError, TooLargeError) as error:
        listed = f"The field {names[0]} is" if len(names) == 1 else f"The fields {', '.join(names)} are"
        ctx.warn("motion", volume.path, f"{listed} not read as velocities, which do not blur the volume: {error}.")
        return None, ()


class UnlikePartsError(Exception):
    """Components of velocities that cannot be joined; the message says why."""


def _joined(parts: Sequence[Field], limit: int, ctx: Context) -> Field:
    """Return the field of vectors whose components are three fields. Raise UnlikePartsError, TooLargeError."""
    if len(parts) != 3:
        raise UnlikePartsError(f"there {'is' if len(parts) == 1 else 'are'} {len(parts)} of three components")
    first = parts[0]
    together = move_together([part.motion for part in parts], ctx.timing)
    if not together or not all(shares_space(first, part) for part in parts):
        raise UnlikePartsError("the components differ in their transforms")
    domain = domain_of(parts)
    if (size := domain.count * 3 * 4) > limit:
        raise TooLargeError(f"they need {size / 1e6:,.0f} MB, and {limit / 1e6:,.0f} MB are allowed")
    leaves = np.stack([part.grid.values_of_leaves(domain.leaf_origins) for part in parts], axis=-1)
    tiles = np.stack([part.grid.values_at(domain.tile_origins) for part in parts], axis=-1)
    return replace(first, grid=domain.grid("velocity", leaves, tiles))


def _grid_of(leaves: Ints, values: npt.NDArray[np.float32], like: VolumeGrid) -> VolumeGrid:
    return VolumeGrid(
        name="velocity",
        grid_class="unknown",
        field_from_index=like.field_from_index,
        background=np.zeros(3, np.float32),
        leaf_origins=leaves,
        leaf_values=values,
        tile_origins=np.zeros((0, 3), np.int32),
        tile_sizes=np.zeros(0, np.int32),
        tile_values=np.zeros((0, 3), np.float32),
        bounds=None,
        active_voxels=len(leaves) * VOXELS,
        nonfinite=0,
        negative=0,
    )


def _extend(leaves: Ints, values: npt.NDArray[np.float32], known: npt.NDArray[np.bool_]) -> None:
    """Set values (n, 512, 3) that are not known to means of those nearby: of 3^3 cubes of voxels around them, which are twice
    as wide from one attempt to the next."""
    lowest = leaves.min(axis=0).astype(np.int64) - LEAF
    flat = values.reshape(-1, 3)
    left = np.flatnonzero(~known)
    if not len(left) or not known.any():
        return
    # Of the values that are known, those in leaves beside others matter.
    cells = (leaves - lowest) // LEAF
    open_cells = cells[~known.all(axis=1)]
    beside = np.unique(_keys((open_cells[:, None] + _AROUND).reshape(-1, 3)))
    at = np.flatnonzero(known & np.isin(_keys(cells), beside)[:, None])
    at = at if len(at) else np.flatnonzero(known)
    places = _places(leaves, at) - lowest
    sums: Doubles = flat[at].astype(np.float64)
    counts: Doubles = np.ones(len(at))
    wanted = _places(leaves, left) - lowest
    size = 1
    while len(left) and size < _WIDEST:
        keys, inverse = np.unique(_keys(places), return_inverse=True)
        counts = np.bincount(inverse, counts, len(keys)).astype(np.float64)
        sums = np.stack([np.bincount(inverse, sums[:, a], len(keys)) for a in range(3)], axis=1)
        places = _places_of(keys)
        cubes_wanted, of = np.unique(_keys(wanted), return_inverse=True)
        centres = _places_of(cubes_wanted)
        total, weight = np.zeros((len(centres), 3)), np.zeros(len(centres))
        for step in _AROUND:
            near = _keys(centres + step)
            found = np.searchsorted(keys, near).clip(max=len(keys) - 1)
            there = keys[found] == near
            total[there] += sums[found[there]]
            weight[there] += counts[found[there]]
        done = weight[of] > 0
        flat[left[done]] = total[of[done]] / weight[of[done], None]
        left, wanted = left[~done], wanted[~done] >> 1
        places, size = places >> 1, 2 * size


def _places(leaves: Ints, rows: Int64s) -> Int64s:
    """Return the voxels (n, 3) of rows of all leaves' voxels."""
    found: Int64s = leaves[rows // VOXELS].astype(np.int64) + _VOXELS_OF_LEAF[rows % VOXELS]
    return found


_BITS = 21


def _keys(places: Int64s) -> Int64s:
    """Return one number for each place with coordinates from -1 to 2^20."""
    x, y, z = (places + 1).T
    found: Int64s = (x << _BITS | y) << _BITS | z
    return found


def _places_of(keys: Int64s) -> Int64s:
    mask = (1 << _BITS) - 1
    return np.stack([keys >> 2 * _BITS, keys >> _BITS & mask, keys & mask], axis=1) - 1
