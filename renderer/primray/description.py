"""The seam between USD and the core: a scene as frozen data and numpy arrays. Knows neither USD nor Embree.

Matrices are 4x4 float64 in column-vector convention, named right to left (`world_from_object`). Lengths are scene
units. Colours are linear in the rendering colour space (`rendering_space`). The package `usd` makes a
SceneDescription; `scene_upload` hands it to the core.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from .aov_names import AovRequest
from .color_space import REC709, ColorSpace
from .frame import Frame, PixelWindow, whole_frame
from .geometry import Doubles, Floats, Interpolation, Ints, Mesh, Primvar, Shape, Sphere, SubdivisionMesh
from .lighting import NO_LINKS, IesProfile, Light, LightType, Linked, Portal, Shadow, Shaping
from .placement import Instances, MatrixInstances, Placement, PointInstances
from .shading import Input, PrimvarInput, Surface, TextureFile, TextureInput, Wrap

__all__ = [
    "AovRequest",
    "Camera",
    "Doubles",
    "Floats",
    "Frame",
    "IesProfile",
    "Input",
    "Instances",
    "Interpolation",
    "Ints",
    "Light",
    "LightType",
    "Linked",
    "MatrixInstances",
    "Mesh",
    "PixelWindow",
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


@dataclass(frozen=True, slots=True)  # there may be millions
class Placed:
    """One shape with its matrix: to the world when static, to the prototype's space inside a Prototype."""

    shape: int
    matrix: Doubles  # (4, 4)
    instance: str = ""  # what the instance is called that it is the only one of; where an AOV asks for instances


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
    scene units (orthographic), already conformed to the image's aspect ratio: what the whole frame shows."""

    path: str  # "" for the automatic one
    world_from_camera: Doubles  # (4, 4), rigid
    projection: Projection
    window: tuple[float, float, float, float]
    clipping_range: tuple[float, float]
    lens_radius: float = 0.0  # scene units; 0: pinhole
    focus_distance: float = 0.0  # scene units, along -Z
    exposure_scale: float = 1.0  # multiplies the image
    # Sides of the lens, a regular polygon whose corners lie on the circle of `lens_radius`; 0: the circle.
    blades: int = 0
    blade_rotation_deg: float = 0.0  # of a corner from +X, towards +Y
    clipping_planes: tuple[tuple[float, float, float, float], ...] = ()  # a x + b y + c z + d < 0 is cut off, camera space
    shutter: tuple[float, float] = (0.0, 0.0)  # opens and closes, in time codes from the frame on; equal: an instant

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
    aovs: tuple[AovRequest, ...] = ()
    pixels: PixelWindow | None = None  # those that are rendered; None: the whole of `resolution`
    pixel_aspect_ratio: float = 1.0
    linked: Linked = NO_LINKS
    rendering_space: ColorSpace = REC709

    @property
    def frame(self) -> Frame:
        if self.pixels is None:
            return whole_frame(*self.resolution, self.pixel_aspect_ratio)
        return Frame(self.resolution, self.pixels, self.pixel_aspect_ratio)
