"""The seam's camera: where it stands, what its window shows, its lens."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles


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
