"""Cameras: placement, window and lens. Part of the description; users may pass one to a render."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from .arrays import Doubles
from .lens.diffusion import NO_DIFFUSION, Diffusion, diffusion_of
from .lens.distortion import Distortion, distortion_as_json, distortion_of


class Projection(Enum):
    """Projection of a camera: rays from one eye, or parallel rays.

    >>> primray.Projection("perspective")
    <Projection.PERSPECTIVE: 'perspective'>
    """

    PERSPECTIVE = "perspective"
    ORTHOGRAPHIC = "orthographic"


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera: placement, window and lens. It looks along -Z of its space, +Y up, +X to the right.

    `world_from_camera` (4, 4), float64, is a rigid transform from camera to world space for points as column vectors, in
    scene units: its first three columns are the camera's right, up and backward directions, its last one the position.
    `window` is (left, right, bottom, top) of the whole frame at unit distance (perspective) or in scene units
    (orthographic); for a lens with distortion, the frame's sides on the film. `Image.camera` is the camera of an image, which
    can be changed and passed to another render:

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=2)
    >>> moved = image.camera.world_from_camera.copy()
    >>> moved[:3, 3] += 0.1 * moved[:3, 2]  # a tenth of a unit back
    >>> camera = dataclasses.replace(image.camera, world_from_camera=moved)
    >>> primray.render("shot.usda", camera=camera, resolution=(32, 18), spp=2).resolution
    (32, 18)

    A render conforms the window to the image's aspect ratio by UsdRenderSettings' aspectRatioConformPolicy.
    """

    path: str  # of its prim; "": none
    world_from_camera: Doubles
    projection: Projection
    window: tuple[float, float, float, float]
    clipping_range: tuple[float, float]  # scene units along -Z
    lens_radius: float = 0.0  # scene units; 0: pinhole
    focus_distance: float = 0.0  # scene units, along -Z
    exposure_scale: float = 1.0  # multiplies the image
    # Sides of the aperture, a regular polygon with its corners on the circle of `lens_radius`; 0: a circle.
    blades: int = 0
    blade_rotation_deg: float = 0.0  # of a corner from +X, towards +Y
    clipping_planes: tuple[tuple[float, float, float, float], ...] = ()  # a x + b y + c z + d < 0 is clipped, camera space
    shutter: tuple[float, float] = (0.0, 0.0)  # opens and closes, in time codes relative to the frame; equal: an instant
    diffusion: Diffusion = NO_DIFFUSION  # in the lens, applied after the render
    distortion: Distortion | None = None  # of a perspective camera
    # Flaws of a perspective camera's lens. Natural vignetting: cos^4 of a ray's angle to the axis. Mechanical vignetting:
    # distance of a second opening, the rim, in front of the lens, and its radius, in scene units (radius 0: none). Chromatic
    # aberration, for red, green and blue: magnification about the axis, and shift of the focus distance.
    natural_vignetting: bool = False
    rim: tuple[float, float] = (0.0, 0.0)
    channel_magnification: tuple[float, float, float] = (1.0, 1.0, 1.0)
    channel_focus_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # Distance from which on things must be placed to a thousandth of a pixel, in scene units; 0: that of the near plane. Of
    # cameras that are close to each other and have the same, all points of a scene that stays are shared.
    nearest: float = 0.0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Camera) and camera_as_json(self) == camera_as_json(other)

    def __hash__(self) -> int:
        return hash((self.path, self.projection, self.window))

    def project(self, points: npt.ArrayLike, resolution: tuple[int, int]) -> Doubles:
        """Return pixel positions (N, 2), x right and y down from the upper left corner, of world `points` (N, 3).

        NaN for points behind a perspective camera, or that a lens with distortion does not see.
        """
        p = np.atleast_2d(np.asarray(points, np.float64))
        camera_from_world = np.linalg.inv(self.world_from_camera)
        q = p @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        xy = q[:, :2].copy()
        if self.distortion is not None and self.projection is Projection.PERSPECTIVE:
            xy = self.distortion.project(q)
        elif self.projection is Projection.PERSPECTIVE:
            depth = np.where(q[:, 2] < 0, -q[:, 2], np.nan)
            xy /= depth[:, None]
        left, right, bottom, top = self.window
        width, height = resolution
        return np.stack([(xy[:, 0] - left) / (right - left) * width, (top - xy[:, 1]) / (top - bottom) * height], axis=1)


def camera_as_json(camera: Camera) -> dict[str, Any]:
    """Return a camera as JSON-compatible values."""
    matrix = np.asarray(camera.world_from_camera, np.float64)
    plain = asdict(replace(camera, distortion=None)) | {
        "world_from_camera": matrix.tolist(),
        "projection": camera.projection.value,
    }
    return plain | {"distortion": distortion_as_json(camera.distortion)}


def camera_of(values: Mapping[str, Any]) -> Camera:
    """Return the camera that camera_as_json serialized; ValueError, KeyError or TypeError for anything else."""
    matrix = np.array(values["world_from_camera"], np.float64)
    left, right, bottom, top = map(float, values["window"])
    near, far = map(float, values["clipping_range"])
    if not (matrix.shape == (4, 4) and right != left and top != bottom and near != far):
        raise ValueError
    distance, radius = map(float, values.get("rim", (0.0, 0.0)))
    red, green, blue = map(float, values.get("channel_magnification", (1.0, 1.0, 1.0)))
    of_red, of_green, of_blue = map(float, values.get("channel_focus_shift", (0.0, 0.0, 0.0)))
    return Camera(
        path=str(values["path"]),
        world_from_camera=matrix,
        projection=Projection(values["projection"]),
        window=(left, right, bottom, top),
        clipping_range=(near, far),
        lens_radius=float(values["lens_radius"]),
        focus_distance=float(values["focus_distance"]),
        exposure_scale=float(values["exposure_scale"]),
        blades=int(values["blades"]),
        blade_rotation_deg=float(values["blade_rotation_deg"]),
        clipping_planes=tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in values["clipping_planes"]),
        shutter=(float(values["shutter"][0]), float(values["shutter"][1])),
        diffusion=diffusion_of(values["diffusion"]) if "diffusion" in values else NO_DIFFUSION,
        distortion=distortion_of(values.get("distortion")),
        natural_vignetting=bool(values.get("natural_vignetting", False)),
        rim=(distance, radius),
        channel_magnification=(red, green, blue),
        channel_focus_shift=(of_red, of_green, of_blue),
        nearest=float(values.get("nearest", 0.0)),
    )
