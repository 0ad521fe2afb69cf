"""The seam between USD and the core: a scene as frozen data and numpy arrays. Knows neither USD nor Embree.

Matrices are 4x4 float64 in column-vector convention, named right to left (`world_from_object`). Lengths are scene
units. Colours are linear in the rendering colour space (Rec.709 primaries, D65). The package `usd` makes a
SceneDescription; `scene_upload` hands it to the core.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from .geometry import Doubles, Floats, Interpolation, Ints, Mesh, Primvar, Shape, Sphere, SubdivisionMesh
from .lighting import IesProfile, Light, LightType, Portal, Shadow, Shaping
from .placement import Instances, MatrixInstances, Placement, PointInstances
from .shading import Input, PrimvarInput, Surface, TextureFile, TextureInput, Wrap

__all__ = [
    "Camera",
    "Doubles",
    "Floats",
    "IesProfile",
    "Input",
    "Instances",
    "Interpolation",
    "Ints",
    "Light",
    "LightType",
    "MatrixInstances",
    "Mesh",
    "Placed",
    "Placement",
    "PointInstances",
    "Portal",
    "Primvar",
    "PrimvarInput",
    "Projection",
    "Prototype",
    "SceneDescription",
    "Shadow",
    "Shape",
    "Shaping",
    "Sphere",
    "SubdivisionMesh",
    "Surface",
    "TextureFile",
    "TextureInput",
    "Wrap",
]


@dataclass(frozen=True)
class Placed:
    """One shape with its matrix: to the world when static, to the prototype's space inside a Prototype."""

    shape: int
    matrix: Doubles  # (4, 4)


@dataclass(frozen=True)
class Prototype:
    """What is stored once and placed many times: shapes, or placements of prototypes that have shapes (two levels at most).

    Nested instancing is multiplied out by translation, up to a budget (usd/instances.py).
    """

    path: str
    shapes: tuple[Placed, ...]
    placements: tuple[Placement, ...] = ()


class Projection(Enum):
    PERSPECTIVE = "perspective"
    ORTHOGRAPHIC = "orthographic"


@dataclass(frozen=True)
class Camera:
    """Looks along -Z of its frame, +Y up. `window` = (left, right, bottom, top) at unit distance (perspective) or in
    scene units (orthographic), already conformed to the image's aspect ratio."""

    path: str  # "" for the automatic one
    world_from_camera: Doubles  # (4, 4), rigid
    projection: Projection
    window: tuple[float, float, float, float]
    clipping_range: tuple[float, float]
    lens_radius: float = 0.0  # scene units; 0: pinhole
    focus_distance: float = 0.0  # scene units, along -Z
    exposure_scale: float = 1.0  # multiplies the image

    def project(self, points: npt.ArrayLike, resolution: tuple[int, int]) -> Doubles:
        """Pixel positions (N, 2), x right and y down from the upper left corner, of world `points` (N, 3).

        Points behind a perspective camera give NaN.
        """
        p = np.atleast_2d(np.asarray(points, np.float64))
        camera_from_world = np.linalg.inv(self.world_from_camera)
        q = p @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        xy = q[:, :2].copy()
        if self.projection is Projection.PERSPECTIVE:
            depth = np.where(q[:, 2] < 0, -q[:, 2], np.nan)
            xy /= depth[:, None]
        left, right, bottom, top = self.window
        width, height = resolution
        return np.stack([(xy[:, 0] - left) / (right - left) * width, (top - xy[:, 1]) / (top - bottom) * height], axis=1)


@dataclass(frozen=True)
class SceneDescription:
    shapes: tuple[Shape, ...]
    surfaces: tuple[Surface, ...]
    static: tuple[Placed, ...]  # shapes used once, world_from_object
    prototypes: tuple[Prototype, ...]
    placements: tuple[Placement, ...]
    lights: tuple[Light, ...]
    camera: Camera
    resolution: tuple[int, int]  # width, height
    up_axis: str
    meters_per_unit: float
    time_code: float | None  # None: USD's default time
