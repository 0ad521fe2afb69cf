"""Origin of the core's coordinates: near the camera, on a grid, so that cameras near each other share it."""

from __future__ import annotations

import numpy as np

from ..arrays import Doubles
from ..camera import Camera

# Cell size relative to the near plane's distance, at most. Everything visible is beyond that plane, so that single precision
# moves it by less than 4e-7 of its distance (a thousandth of a pixel) instead of 6e-8.
CELLS = 8.0


def rebasing_origin(camera: Camera) -> Doubles:
    """Return the origin (3,) in world space. Cell sizes are powers of two, so that grid points are exact however far from the
    world's origin.

    It depends on the camera alone: other geometry never changes the bits of what is visible.
    """
    eye: Doubles = camera.world_from_camera[:3, 3]
    near = camera.clipping_range[0]
    if not 0 < near < np.inf:
        return eye
    cell = 2.0 ** np.floor(np.log2(CELLS * near))
    with np.errstate(invalid="ignore", over="ignore"):
        snapped: Doubles = np.round(eye / cell) * cell
    return snapped if np.isfinite(snapped).all() else eye
