"""The camera with which usdrecord frames a stage without cameras (UsdAppUtilsFrameRecorder), and bounds of the scene."""

from __future__ import annotations

import math

import numpy as np

from ...description import Camera, Projection
from ..adapters.cameras.camera import Aperture, conform, window_of
from ..adapters.rendering.render_product import ProductSettings
from ..scene.bounds import Bounds

# GfCamera's defaults: 50 mm, 35 mm projector aperture.
FOCAL_LENGTH = 50.0
APERTURE = Aperture(20.955, 15.2908)


def framing_camera(bounds: Bounds, z_up: bool, resolution: tuple[int, int], product: ProductSettings) -> Camera:
    """Return a camera that looks at the centre of the bounds, far enough away for them to fit; nothing is clipped."""
    center, size = bounds
    up, depth = (2, 1) if z_up else (1, 2)
    radius = math.hypot(size[0], size[up]) / 2
    tan_half = APERTURE.width / (2 * FOCAL_LENGTH)
    distance = radius / tan_half + size[depth] / 2
    if distance < 1:  # GfCamera's near plane
        distance += 1
    world_from_camera = np.eye(4)
    if z_up:  # looks along +Y with +Z up
        world_from_camera[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    world_from_camera[:3, 3] = center
    world_from_camera[depth, 3] += -distance if z_up else distance
    aperture = conform(APERTURE, resolution, product)
    return Camera("", world_from_camera, Projection.PERSPECTIVE, window_of(aperture, 1 / FOCAL_LENGTH), (0.0, 3e38))
