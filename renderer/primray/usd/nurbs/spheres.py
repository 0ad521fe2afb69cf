"""Spheres as NURBS patches, for left-handed spheres, which exact spheres cannot represent."""

from __future__ import annotations

import numpy as np

from ...description import Direction, NurbsPatch, Primvar

_CORNER = 0.5**0.5  # weight of a quarter circle's middle point (Piegl and Tiller, "The NURBS Book", 7.3)
_CIRCLE = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0))
_ARC = ((0, -1), (1, -1), (1, 0), (1, 1), (0, 1))  # (radius, height) from pole to pole
_AROUND = Direction(9, 3, np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], np.float64), 0.0, 4.0)
_UP = Direction(5, 3, np.array([0, 0, 0, 1, 1, 2, 2, 2], np.float64), 0.0, 2.0)


def inward_sphere(path: str, radius: float, surface: int, primvars: tuple[Primvar, ...]) -> NurbsPatch:
    """Return a sphere about the origin whose normals point inwards."""
    points = radius * np.array([(x * r, y * r, z) for r, z in _ARC for x, y in _CIRCLE])
    weights = np.outer([1, _CORNER, 1, _CORNER, 1], [1, _CORNER] * 4 + [1]).ravel()
    return NurbsPatch(path, points.astype(np.float32), weights, _AROUND, _UP, surface, primvars=primvars, is_flipped=True)
