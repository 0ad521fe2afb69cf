"""From where the core measures lengths: near the camera, on a grid that cameras close to each other share."""

from __future__ import annotations

import numpy as np

from ..arrays import Doubles
from ..camera import Camera

# Cells are at most so many times the distance of the near plane. Whatever is seen is beyond that plane, so that single
# precision moves it by less than 4e-7 of its distance, a thousandth of a pixel, in place of 6e-8.
CELLS = 8.0


def rebasing_origin(camera: Camera) -> Doubles:
    """(3,) world point. The size of cells is a power of two, so that a grid point is exact however far away the world is.

    A function of the camera alone: what else is in the world does not change the bits of what is seen of it.
    """
    eye: Doubles = camera.world_from_camera[:3, 3]
    near = camera.clipping_range[0]
    if not 0 < near < np.inf:
        return eye
    cell = 2.0 ** np.floor(np.log2(CELLS * near))
    with np.errstate(invalid="ignore", over="ignore"):
        snapped: Doubles = np.round(eye / cell) * cell
    return snapped if np.isfinite(snapped).all() else eye
