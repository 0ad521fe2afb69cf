"""Grids of voxels and scenes with volumes that move, described directly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from tests.described import Described

from primray.description import MatrixMotion, VolumeEmission, VolumeMedium
from primray.volumes.volume_grid import VolumeGrid


def grid_of(voxels: Any, first: Sequence[int] = (0, 0, 0), half: bool = False, name: str = "density") -> VolumeGrid:
    """A grid of an array (x, y, z) or (x, y, z, 3), without empty leaves. `first`: the lowest voxel, a multiple of 8."""
    given = np.asarray(voxels, np.float32)
    padded = np.pad(given, [(0, -size % 8) for size in given.shape[:3]] + [(0, 0)] * (given.ndim - 3))
    origins, leaves = [], []
    for place in np.ndindex(*(size // 8 for size in padded.shape[:3])):
        x, y, z = (8 * k for k in place)
        leaf = padded[x : x + 8, y : y + 8, z : z + 8]
        if leaf.any():
            origins.append(np.add(first, (x, y, z)))
            leaves.append(leaf.reshape(512, *given.shape[3:]))
    return VolumeGrid(
        name=name,
        grid_class="fog volume",
        field_from_index=np.eye(4),
        background=np.zeros(given.shape[3:], np.float32),
        leaf_origins=np.array(origins, np.int32).reshape(-1, 3),
        leaf_values=np.array(leaves, np.float16) if half else np.array(leaves, np.float32),
        tile_origins=np.zeros((0, 3), np.int32),
        tile_sizes=np.zeros(0, np.int32),
        tile_values=np.zeros((0, *given.shape[3:]), np.float32),
        bounds=None,
        active_voxels=given.size,
        nonfinite=0,
        negative=0,
    )


def medium(
    grid: VolumeGrid, matrices: Sequence[Any], extinction: float = 0.25, albedo: float = 0.0, **more: Any
) -> VolumeMedium:
    """A medium with one instance for each matrix (4, 4)."""
    placed = np.array(matrices, np.float64)
    return VolumeMedium(path="/smoke", grid=grid, extinction=(extinction,) * 3, albedo=(albedo,) * 3, matrices=placed, **more)


def emission(grid: VolumeGrid, matrices: Sequence[Any], radiance: float = 1.0, **more: Any) -> VolumeEmission:
    return VolumeEmission(path="/fire", grid=grid, emission=(radiance,) * 3, matrices=np.array(matrices, np.float64), **more)


def path_of(matrices: Sequence[Any], times: Sequence[float] = (), turns: bool = False) -> MatrixMotion:
    """The motion of one instance, by its matrices (4, 4) at times."""
    steps = np.array([np.asarray(m)[:3] for m in matrices], np.float64)[:, None]
    return MatrixMotion(np.array(times or np.linspace(0, 1, len(steps))), steps, turns)


def with_volumes(scene: Described, media: Sequence[VolumeMedium] = (), emissions: Sequence[VolumeEmission] = ()) -> Described:
    return replace(scene, description=replace(scene.description, media=tuple(media), volume_emissions=tuple(emissions)))


def trapezoid(x: Any, low: float, high: float) -> Any:
    """Interpolated values along an axis of voxels `low` to `high` with the value 1."""
    return np.clip(np.minimum(x - (low - 1), high + 1 - x), 0.0, 1.0)
