"""Grids of OpenVDB files whose values can be rendered: finite, at least 0, and 0 outside of leaves and tiles.

A grid is read once while anything refers to it, for as long as its file has the same size and time of change: scenes that are
translated again do not read it again.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np
import numpy.typing as npt
from pxr import Ar

from ...errors import AssetError
from ...process_memory import machine_bytes
from ...read_files import note_read
from ...volumes.vdb_bytes import VdbError
from ...volumes.vdb_file import GridInfo, find_grid, list_grids, read_grid
from ...volumes.volume_grid import LEVEL_SET, VolumeGrid
from ..stage.reads import read_asset

TOO_LARGE = "volume-too-large"
_ROWS = 1 << 12  # leaves at a time
_MOST_EXPANSION = 16  # a leaf has two masks of 64 bytes in a file, and at most 2,048 bytes of values in memory


class UnreadableGridError(Exception):
    """A grid that cannot be used: the diagnostic's code and the reason."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason.rstrip(".")


@dataclass(frozen=True, eq=False)
class FileGrid:
    """What a file says of a grid, and what was changed for rendering it."""

    value_type: str  # as the file has it: "float", "vec3s", ...
    changes: tuple[str, ...]  # sentences about values that are not rendered as the file has them


_READ: WeakValueDictionary[tuple[object, ...], VolumeGrid] = WeakValueDictionary()
_FOUND: WeakKeyDictionary[VolumeGrid, FileGrid] = WeakKeyDictionary()


def grid_of_file(
    path: str, name: str | None, index: int, limit: int | None, *, signed_width: int = 0
) -> tuple[VolumeGrid, FileGrid]:
    """Return a grid of a file, the only one if `name` is None, and what was found in it.

    `limit`: the most bytes that it may have. `signed_width`: values of so many numbers keep their signs (velocities).

    `path` is resolved: a file, or a member of a package. Raises UnreadableGridError.
    """
    note_read(path)
    key = (*_state_of(path), name, index, limit, signed_width)
    grid = _READ.get(key)
    if grid is None:
        grid, found = _read(path, name, index, machine_bytes() // 2 if limit is None else limit, signed_width)
        _READ[key], _FOUND[grid] = grid, found
    return grid, _FOUND[grid]


def _state_of(path: str) -> tuple[object, ...]:
    """Return what tells a file from what it was before."""
    file = str(Ar.SplitPackageRelativePathOuter(path)[0])
    try:
        found = os.stat(file)
    except OSError:
        return path, object()
    return path, found.st_mtime_ns, found.st_size, found.st_ino


def _read(path: str, name: str | None, index: int, limit: int, signed_width: int) -> tuple[VolumeGrid, FileGrid]:
    try:
        data = read_asset(path)
    except AssetError as error:
        raise UnreadableGridError("asset-missing", str(error)) from None
    try:
        grids = list_grids(data)
        info = _only(grids) if name is None else find_grid(grids, name, index)
        _check_size(info, len(data), limit)
        return _usable(read_grid(data, grids, info), info, signed_width)
    except VdbError as error:
        raise UnreadableGridError("volume-field", f"{error}") from None


def _only(grids: tuple[GridInfo, ...]) -> GridInfo:
    if len(grids) != 1:
        names = ", ".join(repr(grid.name) for grid in grids) or "none"
        raise VdbError(f"the file: no fieldName says which of its grids is meant: {names}")
    return grids[0]


def _check_size(info: GridInfo, file_bytes: int, limit: int) -> None:
    """Raise UnreadableGridError if a grid certainly exceeds the limit."""
    if info.active_voxels is None:
        return
    of_voxel = (2 if info.is_half else 4) * (3 if info.value_type.startswith("vec3") else 1)
    expected = min(info.active_voxels * of_voxel, file_bytes * _MOST_EXPANSION)
    if expected > limit:
        reason = f"grid {info.name!r} has {info.active_voxels:,} voxels, which need {expected / 1e6:,.0f} MB; "
        raise UnreadableGridError(TOO_LARGE, reason + f"{limit / 1e6:,.0f} MB are allowed")


def _usable(grid: VolumeGrid, info: GridInfo, signed_width: int) -> tuple[VolumeGrid, FileGrid]:
    """Return the grid with 0 for values that are not finite, for its background and, unless it has velocities, for values
    that are negative."""
    changes: list[str] = []
    lowest = 0.0
    if grid.width == signed_width:
        grid, lowest = replace(grid, negative=0), -math.inf
    if grid.grid_class == LEVEL_SET:
        changes.append(
            "It is a level set: its distances are read as they are, those inside as 0. "
            "OpenVDB's sdfToFogVolume makes a density of it."
        )
    elif grid.nonfinite or grid.negative:
        kinds = (("negative", grid.negative), ("not finite", grid.nonfinite))
        counted = " and ".join(
            f"{count:,} {'value is' if count == 1 else 'values are'} {kind}" for kind, count in kinds if count
        )
        changes.append(f"{counted}: {'it is' if grid.negative + grid.nonfinite == 1 else 'they are'} read as 0.")
    if np.any(grid.background != 0):
        changes.append(f"Its background is {_shown(grid.background)}: it is read as 0.")
    tiles = _clean(grid.tile_values.copy(), lowest) if grid.nonfinite or grid.negative else grid.tile_values
    if grid.nonfinite or grid.negative:
        for start in range(0, len(grid.leaf_values), _ROWS):
            _clean(grid.leaf_values[start : start + _ROWS], lowest)
    kept = (tiles != 0).reshape(len(tiles), grid.width).any(axis=1)
    cleaned = replace(
        grid,
        background=np.zeros_like(grid.background),
        tile_origins=grid.tile_origins[kept],
        tile_sizes=grid.tile_sizes[kept],
        tile_values=tiles[kept],
        nonfinite=0,
        negative=0,
    )
    return cleaned, FileGrid(info.value_type, tuple(changes))


def _shown(value: npt.NDArray[Any]) -> str:
    return ", ".join(f"{x:g}" for x in np.atleast_1d(value).tolist())


def _clean(values: npt.NDArray[Any], lowest: float) -> npt.NDArray[Any]:
    """Set values to 0 in place that are not finite or are below `lowest`."""
    values[~(np.isfinite(values) & (values >= lowest))] = 0
    return values
