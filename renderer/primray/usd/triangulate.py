"""Polygons to triangles, with numpy for all but concave ones; every triangle remembers its face and its corners.

Triangles keep the polygon's own winding: cross(p1 - p0, p2 - p0) points along the polygon's right-handed normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..description import Doubles, Ints
from .ear_clip import ear_clip
from .vectors import cross

Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Triangles:
    points: Ints  # (T, 3) indices of points
    corners: Ints  # (T, 3) indices into the mesh's faceVertexIndices, for values per corner
    faces: Ints  # (T,) indices of faces, for values per face, in order


def triangulate(points: npt.NDArray[np.floating], counts: Ints, indices: Ints, keep: Mask | None = None) -> Triangles:
    """Triangles of the faces that `keep` marks (all if None); those without area are left out.

    The topology must be valid: counts sum to the indices' number; kept faces have 3 vertices or more, all in range.
    """
    starts = np.zeros(len(counts), np.int64)
    np.cumsum(counts[:-1], out=starts[1:])
    faces = np.arange(len(counts)) if keep is None else np.flatnonzero(keep)
    if len(faces) == 0:
        return Triangles(np.zeros((0, 3), np.int32), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))
    in_double = points.astype(np.float64)
    sizes = counts[faces]
    if sizes.min() == sizes.max():
        corners, owners, solid = _of_size(in_double, indices, starts, faces, int(sizes[0]))
        if solid:
            return Triangles(indices[corners].astype(np.int32, copy=False), corners.astype(np.int32), owners.astype(np.int32))
    else:
        parts = [_of_size(in_double, indices, starts, faces[sizes == n], int(n)) for n in np.unique(sizes)]
        owners = np.concatenate([owner for _, owner, _ in parts])
        order = np.argsort(owners, kind="stable")
        corners, owners = np.concatenate([corner for corner, _, _ in parts])[order], owners[order]
    return _with_area(in_double, indices, corners, owners)


def flipped(triangles: Triangles) -> Triangles:
    """The same triangles with the opposite winding."""
    order = [0, 2, 1]
    return Triangles(triangles.points[:, order], triangles.corners[:, order], triangles.faces)


def _with_area(points: Doubles, indices: Ints, corners: Indices, faces: Indices) -> Triangles:
    """Without the triangles whose area is zero in double."""
    triangles = indices[corners]
    p = points[triangles]
    solid = cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]).any(axis=1)
    if not solid.all():
        triangles, corners, faces = triangles[solid], corners[solid], faces[solid]
    return Triangles(triangles.astype(np.int32, copy=False), corners.astype(np.int32), faces.astype(np.int32))


def _of_size(points: Doubles, indices: Ints, starts: Indices, faces: Indices, n: int) -> tuple[Indices, Indices, bool]:
    """Corners (T, 3) and faces (T,) of polygons that all have n vertices, and whether all are known to have area."""
    corners = starts[faces][:, None] + np.arange(n)
    if n == 3:
        return corners, faces, False
    bent = _turns(points[indices[corners]]) <= 0
    if not bent.any():
        return _fans(corners), np.repeat(faces, n - 2), n == 4  # a quad's triangles are two of its corners
    number = bent.sum(axis=1)
    if n == 4:  # a quad's fan from its one reflex vertex is right
        one = number == 1
        pivot = np.where(one, bent.argmax(axis=1), 0)
        corners = np.take_along_axis(corners, (pivot[:, None] + np.arange(4)) % 4, axis=1)
        number = np.where(one, 0, number)
    triangles = _fans(corners).reshape(len(faces), n - 2, 3)
    for f in np.flatnonzero(number):
        triangles[f] = corners[f][ear_clip(points[indices[corners[f]]])]
    return triangles.reshape(-1, 3), np.repeat(faces, n - 2), False


def _fans(corners: Indices) -> Indices:
    """(F * (n - 2), 3): triangles (0, j, j + 1) of each polygon."""
    count, n = corners.shape
    fan = np.empty((count, n - 2, 3), np.int64)
    fan[:, :, 0] = corners[:, :1]
    fan[:, :, 1] = corners[:, 1:-1]
    fan[:, :, 2] = corners[:, 2:]
    return fan.reshape(-1, 3)


def _turns(p: Doubles) -> Doubles:
    """(F, n) from vertices (F, n, 3): how each corner turns about its polygon's Newell normal; <= 0 is reflex or flat."""
    n = p.shape[1]
    edge = p[:, np.arange(1, n + 1) % n] - p
    before = edge[:, np.arange(-1, n - 1)]
    spoke = p - p[:, :1]
    normal = cross(spoke[:, 1:-1], spoke[:, 2:]).sum(axis=1)
    turn: Doubles = np.einsum("fnk,fk->fn", cross(before, edge), normal)
    flat = 1e-12 * np.einsum("fk,fk->f", normal, normal)[:, None]  # rounding of points in float cannot tell these from 0
    return np.where(turn <= flat, np.minimum(turn, 0.0), turn)
