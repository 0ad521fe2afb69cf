"""Volumes of a scene description: media whose density is a grid of voxels, and grids that emit light.

Media are independent of each other: where several overlap, their coefficients add. Emission is not multiplied by any
extinction. Interpolation between voxel centres, which are at integer coordinates of index space, is trilinear; a grid is 0
outside of its leaves and tiles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Doubles
from .motion import MatrixMotion
from .placement import Box, transformed_box
from .shading import CameraVisibility, Color

if TYPE_CHECKING:
    from ..volumes.volume_grid import VolumeGrid


@dataclass(frozen=True, eq=False, kw_only=True)
class VelocityBlur:
    """Blur of a grid over the exposure: at time t its value at x is that at x - v (t - frame), with the velocity v at x.

    Velocities are interpolated like values, but voxel by voxel: of the eight around x, each displaces by its own velocity, and
    the mean of what they find has the weights of trilinear interpolation.
    """

    velocity: VolumeGrid  # of three numbers a voxel: voxels per span of the exposure, on the index space of what is blurred
    frame: float  # fraction of the span at which nothing is displaced; it may be outside of it


@dataclass(frozen=True, eq=False, kw_only=True)
class VolumeMedium:
    """A medium whose extinction coefficient is that of a grid's values times `extinction`, placed once or several times."""

    path: str  # of the Volume prim
    grid: VolumeGrid  # of one number a voxel, at least 0
    extinction: Color  # per unit of a value, and of scene length
    albedo: Color  # single scattering albedo
    albedo_grid: VolumeGrid | None = None  # three numbers a voxel, multiplied with `albedo`, on the index space of `grid`
    anisotropy: float = 0.0  # g of Henyey and Greenstein; above 0 light is scattered forward
    droplets: float = 0.0  # diameter of water droplets in micrometres, whose phase function it has; 0: none
    matrices: Doubles  # (N, 4, 4) world_from_index, one for each instance, at the frame
    motion: MatrixMotion | None = None  # of the instances
    blur: VelocityBlur | None = None  # of `grid`, and of `albedo_grid` with it
    material: str = ""  # path of the bound material
    camera: CameraVisibility = CameraVisibility.SEEN


@dataclass(frozen=True, eq=False, kw_only=True)
class VolumeEmission:
    """A grid that emits light, placed once or several times."""

    path: str  # of the Volume prim
    grid: VolumeGrid  # of one or three numbers a voxel, at least 0
    emission: Color  # radiance per scene length, and per unit of a value
    matrices: Doubles  # (N, 4, 4) world_from_index, one for each instance, at the frame
    motion: MatrixMotion | None = None  # of the instances
    blur: VelocityBlur | None = None
    camera: CameraVisibility = CameraVisibility.SEEN


def volume_boxes(volumes: Iterable[VolumeMedium | VolumeEmission]) -> Doubles:
    """Return the boxes (V, 2, 3) around all instances of each volume in the world; volumes without instances have none."""
    found = [box for volume in volumes if (box := volume_box(volume)) is not None]
    return np.array(found).reshape(-1, 2, 3)


def volume_box(volume: VolumeMedium | VolumeEmission) -> Box | None:
    """Return the box around all instances of a volume in the world; None where it is empty."""
    boxes = instance_boxes(volume)
    return None if boxes is None or not len(boxes[0]) else (boxes[0].min(axis=0), boxes[1].max(axis=0))


def instance_boxes(volume: VolumeMedium | VolumeEmission) -> Box | None:
    """Return the world boxes, low and high corners (N, 3), of a volume's instances; None where all of its voxels are 0."""
    reach = volume.grid.support
    return None if reach is None else transformed_box(volume.matrices, (reach[0], reach[1]))
