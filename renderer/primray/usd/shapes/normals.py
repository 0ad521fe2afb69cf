"""Shading normals of triangles from a mesh's authored normals."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from .primvars import Primvar, is_per_point, per_corner
from .seam_mesh import Values
from .triangulate import Triangles
from .vectors import cross


def shading_normals(normals: Primvar, points: Floats, triangles: Triangles) -> Values:
    """Return unit normals per point or per corner; zero-length and non-finite normals are replaced by the face normal."""
    per_point = is_per_point(normals)
    values = normals.values if per_point else per_corner(normals, triangles)
    length = np.linalg.norm(values.astype(np.float64), axis=1)
    good = np.isfinite(length) & (length > 0)
    if good.all():
        return Values((values / length[:, None]).astype(np.float32), "point" if per_point else "corner")
    if per_point:
        at = triangles.points.ravel()
        values, length, good = values[at], length[at], good[at]
    p = points.astype(np.float64)[triangles.points]
    face = cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    face /= np.linalg.norm(face, axis=1)[:, None]
    unit = np.where(good[:, None], values / np.where(good, length, 1.0)[:, None], np.repeat(face, 3, axis=0))
    return Values(unit.astype(np.float32), "corner")
