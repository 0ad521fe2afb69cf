"""Polygons to triangles, with numpy for all but concave ones; every triangle remembers its face and its corners.

Triangles keep the polygon's own winding: cross(p1 - p0, p2 - p0) points along the polygon's right-handed normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..description import Doubles, Ints
from .ear_clip import ear_clip

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Triangles:
    points: Ints  # (T, 3) indices of points
    corners: Ints  # (T, 3) indices into the mesh's faceVertexIndices, for values per corner
    faces: Ints  # (T,) indices of faces, for values per face


def triangulate(points: npt.NDArray[np.floating], counts: Ints, indices: Ints, keep: Mask | None = None) -> Triangles:
    """Triangles of the faces that `keep` marks (all if None); topology must be valid: counts sum to the indices' number,
    indices are in range, counts of kept faces are at least 3. Triangles without area are left out."""
    starts = np.zeros(len(counts), np.int64)
    np.cumsum(counts[:-1], out=starts[1:])
    faces = np.arange(len(counts)) if keep is None else np.flatnonzero(keep)
    sizes = counts[faces]
    if len(faces) and sizes.max() == 3:
        corners = starts[faces][:, None] + np.arange(3)
        of_face = faces
    else:
        corners, of_face = _fans(points, indices, starts, faces, sizes)
    return _with_area(points, indices, corners, of_face)


def flipped(triangles: Triangles) -> Triangles:
    """The same triangles with the opposite winding."""
    order = [0, 2, 1]
    return Triangles(triangles.points[:, order], triangles.corners[:, order], triangles.faces)


def _with_area(points: npt.NDArray[np.floating], indices: Ints, corners: npt.NDArray[np.int64], faces: Ints) -> Triangles:
    """Without the triangles whose area is zero in double."""
    triangles = indices[corners]
    p = points.astype(np.float64)[triangles]
    solid = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]).any(axis=1)
    if not solid.all():
        triangles, corners, faces = triangles[solid], corners[solid], faces[solid]
    return Triangles(triangles.astype(np.int32, copy=False), corners.astype(np.int32), faces.astype(np.int32))


def _fans(
    points: npt.NDArray[np.floating], indices: Ints, starts: npt.NDArray[np.int64], faces: Ints, sizes: Ints
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Corners (T, 3) and faces (T,): fans from each polygon's first vertex, or from the reflex one of a quad; ears for the rest."""
    first = starts[faces]
    total = int(sizes.sum())
    offsets = np.zeros(len(sizes), np.int64)
    np.cumsum(sizes[:-1], out=offsets[1:])
    owner = np.repeat(np.arange(len(sizes)), sizes)
    local = np.arange(total) - offsets[owner]
    turn = _turns(points, indices, first, sizes, offsets, owner, local)
    flat_or_reflex = turn <= 0
    flat_or_reflex[sizes[owner] == 3] = False
    pivot = np.zeros(len(sizes), np.int64)
    is_concave = np.zeros(len(sizes), bool)
    if flat_or_reflex.any():
        where = np.flatnonzero(flat_or_reflex)
        number = np.bincount(owner[where], minlength=len(sizes))
        pivot[owner[where]] = local[where]
        is_concave = (number > 0) & ((sizes > 4) | (number > 1))
        pivot[is_concave] = 0
    # Fans: triangle j of a polygon is (pivot, pivot + j + 1, pivot + j + 2).
    fan = np.flatnonzero(~is_concave)
    number = sizes[fan] - 2
    fan_owner = np.repeat(fan, number)
    begin = np.zeros(len(fan), np.int64)
    np.cumsum(number[:-1], out=begin[1:])
    j = np.arange(len(fan_owner)) - np.repeat(begin, number)
    steps = np.stack([np.zeros_like(j), j + 1, j + 2], axis=1) + pivot[fan_owner][:, None]
    corners = first[fan_owner][:, None] + steps % sizes[fan_owner][:, None]
    of_face = faces[fan_owner]
    concave = np.flatnonzero(is_concave)
    if len(concave) == 0:
        return corners, of_face
    pieces, owners = [corners], [of_face]
    for polygon in concave:
        at = first[polygon] + np.arange(sizes[polygon])
        ears = ear_clip(points[indices[at]].astype(np.float64))
        pieces.append(first[polygon] + ears)
        owners.append(np.full(len(ears), faces[polygon]))
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(pieces)[order], np.concatenate(owners)[order]


def _turns(
    points: npt.NDArray[np.floating],
    indices: Ints,
    first: npt.NDArray[np.int64],
    sizes: Ints,
    offsets: npt.NDArray[np.int64],
    owner: npt.NDArray[np.int64],
    local: npt.NDArray[np.int64],
) -> Doubles:
    """Per corner: how it turns about the polygon's normal (Newell's: the sum of cross products); <= 0 is reflex or flat."""
    size, base = sizes[owner], first[owner]
    p = points[indices[base + local]].astype(np.float64)
    after = points[indices[base + (local + 1) % size]].astype(np.float64)
    before = points[indices[base + (local - 1) % size]].astype(np.float64)
    origin = p[offsets][owner]
    normal = np.add.reduceat(np.cross(p - origin, after - origin), offsets, axis=0)[owner]
    cross = np.cross(p - before, after - p)
    turn = np.einsum("ij,ij->i", cross, normal)
    scale = np.einsum("ij,ij->i", normal, normal)
    turn[turn <= 1e-12 * scale] = np.minimum(turn[turn <= 1e-12 * scale], 0.0)
    return np.asarray(turn)
