"""What a polygon of light brings to a point, in closed form."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]


def lambert_polygon(p: Doubles, n: Doubles, corners: Doubles) -> float:
    """Lambert's contour integral, 1760: irradiance under unit radiance of a polygon wholly above the horizon."""
    v = (corners - p) / np.linalg.norm(corners - p, axis=1, keepdims=True)
    w = np.roll(v, -1, axis=0)
    cross = np.cross(v, w)
    sine = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(sine, (v * w).sum(axis=1))
    return abs(float((angle / sine) @ cross @ n)) / 2
