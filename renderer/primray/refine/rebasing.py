"""From where the core measures lengths: near the camera, on a grid that cameras close to each other share."""

from __future__ import annotations

import numpy as np

from ..arrays import Doubles
from ..camera import Camera

# The origin is nearer to the camera than half of this part of its distance to what it sees: the float grid is as fine there as
# if all were measured from the camera itself, within a binary digit.
CELL = 0.5


def rebasing_origin(camera: Camera, low: Doubles, high: Doubles) -> Doubles:
    """(3,) world point. `low`, `high`: (N, 3) boxes of what is placed in the world.

    Cells are as large as the distance to the nearest box allows, or to the near plane, whichever is farther: what is nearer
    than that is not seen. Their size is a power of two, so that a grid point is exact however far away the world is.
    """
    eye: Doubles = camera.world_from_camera[:3, 3]
    with np.errstate(invalid="ignore", over="ignore"):
        outside = np.fmax(np.fmax(low - eye, eye - high), 0.0)
        nearest = float(np.fmin.reduce(np.sqrt(np.sum(outside * outside, axis=1)), initial=np.inf))
        distance = max(camera.clipping_range[0], nearest if np.isfinite(nearest) else 0.0)
        cell = 2.0 ** np.floor(np.log2(CELL * distance)) if distance > 0 else 0.0
        snapped: Doubles = np.round(eye / cell) * cell if cell > 0 else eye
    return snapped if np.isfinite(snapped).all() else eye
