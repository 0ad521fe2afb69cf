"""Triangulation of polygons, in numpy except for concave ones; every triangle keeps the indices of its face and corners.

Triangles keep the polygon's winding: cross(p1 - p0, p2 - p0) points along the polygon's right-handed normal.

`paired_triangles` reorders triangles into pairs that form quads, which rays intersect faster (the core's bvh/pairs.hpp). Every
quad mesh has such pairs. Meshes that were triangulated before export list the two halves either one after the other, row by
row, or all first halves before all second halves. Other orders are left unchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats, Ints
from ...description.geometry import FEWEST_PAIRED_TRIANGLES
from ...tessellation.ear_clip import ear_clip

Mask = npt.NDArray[np.bool_]
Points = npt.NDArray[np.floating]
BLOCK = 1 << 12
_NEXT, _BEFORE = np.array([1, 2, 3, 0]), np.array([3, 0, 1, 2])


@dataclass(frozen=True)
class Triangles:
    points: Ints  # (T, 3) point indices
    corners: Ints  # (T, 3) indices into the mesh's faceVertexIndices, for values per corner
    faces: Ints  # (T,) face indices, ascending, for values per face


LARGEST = np.float32(1e37)  # largest coordinate: sums of a few, as subdivision makes them, stay finite

# Triangulates polygons: from points, counts, indices and the mask of faces to keep, as `triangulate` has them, to the points
# (T, 3), corners (T, 3) and faces (T,) of triangles, and the number of kept faces without any. None where not all faces can be
# kept and no mask says which: they have at least three vertices, all in range, and all points are finite. The compiled core has
# one.
Triangulator = Callable[[Floats, Ints, Ints, Mask | None], tuple[Ints, Ints, Ints, int] | None]


def triangulated(points: Floats, counts: Ints, indices: Ints, keep: Mask | None) -> tuple[Ints, Ints, Ints, int] | None:
    """Triangulate polygons without the compiled core."""
    if keep is None and not _are_usable(points, counts, indices):
        return None
    found = triangulate(points, counts, indices, keep)
    kept = len(counts) if keep is None else int(keep.sum())
    return found.points, found.corners, found.faces, kept - len(np.unique(found.faces))


def _are_usable(points: Floats, counts: Ints, indices: Ints) -> bool:
    in_range = bool(((indices >= 0) & (indices < len(points))).all())
    return in_range and bool((counts >= 3).all()) and bool((np.abs(points) <= LARGEST).all())


def triangulate(points: Points, counts: Ints, indices: Ints, keep: Mask | None = None) -> Triangles:
    """Return the triangles of the faces in the mask `keep` (None: all); those without area are left out.

    The topology must be valid: counts sum to the number of indices; kept faces have at least 3 vertices, all in range.
    """
    if (keep is not None and not keep.any()) or len(counts) == 0:
        return Triangles(np.zeros((0, 3), np.int32), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))
    low, high = int(counts.min()), int(counts.max())
    if keep is None and low == high:
        corners = np.arange(len(indices), dtype=np.int32).reshape(-1, low)
        return _solid_triangles(points, indices, *_of_size(points, indices, corners, np.arange(len(counts), dtype=np.int32)))
    faces = np.arange(len(counts), dtype=np.int32) if keep is None else np.flatnonzero(keep).astype(np.int32)
    starts = (np.cumsum(counts, dtype=np.int64) - counts).astype(np.int32)
    sizes = counts[faces]
    parts = []
    for n in np.unique(sizes):
        chosen = faces[sizes == n]
        parts.append(_of_size(points, indices, starts[chosen][:, None] + np.arange(n, dtype=np.int32), chosen))
    if len(parts) == 1:
        return _solid_triangles(points, indices, *parts[0])
    owners = np.concatenate([owner for _, owner, _ in parts])
    order = np.argsort(owners, kind="stable")
    return _solid_triangles(points, indices, np.concatenate([corner for corner, _, _ in parts])[order], owners[order], False)


def reversed_triangles(triangles: Triangles) -> Triangles:
    """Return the triangles with opposite winding."""
    order = [0, 2, 1]
    return Triangles(triangles.points[:, order], triangles.corners[:, order], triangles.faces)


def _solid_triangles(points: Points, indices: Ints, corners: Ints, faces: Ints, solid: bool) -> Triangles:
    """Return the triangles without those of zero area in double precision, unless all are known to be `solid`."""
    triangles = indices[corners].astype(np.int32, copy=False)
    if not solid:
        has_area = _area_mask(points, triangles)
        if not has_area.all():
            triangles, corners, faces = triangles[has_area], corners[has_area], faces[has_area]
    return Triangles(triangles, corners, faces)


def _area_mask(points: Points, triangles: Ints) -> Mask:
    """Return the mask of triangles with area, computed in double precision; for many triangles, only where single precision
    leaves doubt."""
    if len(triangles) <= BLOCK or points.dtype != np.float32:
        return np.concatenate([_has_area(points[block].astype(np.float64)) for block in _blocks(triangles)])
    sure = _surely_have_area(points, triangles)
    doubtful = np.flatnonzero(~sure)
    for block in _blocks(doubtful.astype(np.int32)):
        sure[block] = _has_area(points[triangles[block]].astype(np.float64))
    return sure


def _surely_have_area(points: Points, triangles: Ints) -> Mask:
    """Return the mask of triangles where |u x v| in single precision exceeds its rounding error of 4 * 2^-24 |u| |v| (sums of
    absolute values) by a wide margin."""
    x, y, z = (np.ascontiguousarray(points[:, k]) for k in range(3))
    sure = np.empty(len(triangles), bool)
    with np.errstate(over="ignore", invalid="ignore"):
        for start in range(0, len(triangles), 4 * BLOCK):
            i, j, k = triangles[start : start + 4 * BLOCK].T
            ux, uy, uz, vx, vy, vz = x[j] - x[i], y[j] - y[i], z[j] - z[i], x[k] - x[i], y[k] - y[i], z[k] - z[i]
            size = np.abs(uy * vz - uz * vy) + np.abs(uz * vx - ux * vz) + np.abs(ux * vy - uy * vx)
            sides = (np.abs(ux) + np.abs(uy) + np.abs(uz)) * (np.abs(vx) + np.abs(vy) + np.abs(vz))
            sure[start : start + 4 * BLOCK] = size > np.float32(1e-5) * sides + np.float32(1e-30)
    return sure


def _has_area(p: Doubles) -> Mask:
    return np.asarray(cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]).any(axis=1))


def _of_size(points: Points, indices: Ints, corners: Ints, faces: Ints) -> tuple[Ints, Ints, bool]:
    """Return corners (T, 3) and faces (T,) of polygons (F, n) with n vertices each, and whether all are known to have area."""
    n = corners.shape[1]
    if n == 3:
        return corners, faces, False
    bends = quad_bends if n == 4 else _bends
    bent = np.concatenate([bends(points[indices[block]].astype(np.float64)) for block in _blocks(corners)])
    if not bent.any():
        return _fans(corners), np.repeat(faces, n - 2), n == 4  # a convex quad's triangles have the area of two of its corners
    number = bent.sum(axis=1)
    if n == 4:  # a fan from the one reflex vertex of a quad is correct
        one = number == 1
        pivot = np.where(one, bent.argmax(axis=1), 0)
        corners = np.take_along_axis(corners, (pivot[:, None] + np.arange(4)) % 4, axis=1)
        number = np.where(one, 0, number)
    triangles = _fans(corners).reshape(len(faces), n - 2, 3)
    for f in np.flatnonzero(number):
        triangles[f] = corners[f][ear_clip(points[indices[corners[f]]].astype(np.float64))]
    return triangles.reshape(-1, 3), np.repeat(faces, n - 2), False


def _blocks(rows: Ints) -> list[Ints]:
    """Split rows into blocks whose vertices fit the cache in double precision."""
    return [rows[start : start + BLOCK] for start in range(0, len(rows), BLOCK)]


def _fans(corners: Ints) -> Ints:
    """Return triangles (0, j, j + 1) of each polygon, (F * (n - 2), 3)."""
    count, n = corners.shape
    fan = np.empty((count, n - 2, 3), np.int32)
    fan[:, :, 0] = corners[:, :1]
    fan[:, :, 1] = corners[:, 1:-1]
    fan[:, :, 2] = corners[:, 2:]
    return fan.reshape(-1, 3)


def quad_bends(p: Doubles) -> Mask:
    """Return the mask of reflex or straight corners of quads (F, 4, 3), whose Newell normal is the sum of two opposite corners'
    normals."""
    edge = p[:, _NEXT] - p
    own = cross(edge[:, _BEFORE], edge)
    return _turn_against(own, own[:, 1] + own[:, 3])


def _bends(p: Doubles) -> Mask:
    """Return the mask (F, n) of corners of polygons (F, n, 3) that turn against their polygon's Newell normal, or not at
    all."""
    n = p.shape[1]
    edge = p[:, np.arange(1, n + 1) % n] - p
    before = edge[:, np.arange(-1, n - 1)]
    spoke = p - p[:, :1]
    normal = cross(spoke[:, 1:-1], spoke[:, 2:]).sum(axis=1)
    return _turn_against(cross(before, edge), normal)


def _turn_against(own: Doubles, normal: Doubles) -> Mask:
    # Corners this close to straight are within the rounding of single-precision points.
    return np.asarray(np.vecdot(own, normal[:, None]) <= 1e-12 * np.vecdot(normal, normal)[:, None])


def cross(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return a x b for arrays of the same shape (..., 3)."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(a.shape)
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out


_FOLLOWING, _PREVIOUS = (1, 2, 0), (2, 0, 1)


def paired_triangles(triangles: Triangles) -> Triangles:
    """Return the triangles in pairs (a, c, d) and (a, b, c) if all of them pair up, otherwise unchanged."""
    points = triangles.points
    count = len(points)
    if count < FEWEST_PAIRED_TRIANGLES or count % 2:
        return triangles
    for distance in _pair_distances(points):
        halves = points.reshape(-1, 2, distance, 3).swapaxes(0, 1).reshape(2, -1, 3)
        found = _pair_layout(halves)
        if found is not None:
            return _reordered(triangles, distance, *found)
    return triangles


def _pair_distances(points: Ints) -> list[int]:
    """Return the possible offsets from a triangle to the one that shares an edge with it, limited to those that divide the
    triangle count evenly."""
    first = points[0]
    shared = (points == first[0]).astype(np.int8)
    shared += points == first[1]
    shared += points == first[2]
    neighbours = np.flatnonzero(shared.sum(axis=1) == 2)
    return [d for d in neighbours.tolist() if d > 0 and len(points) % (2 * d) == 0]


def _pair_layout(halves: npt.NDArray[np.int32]) -> tuple[int, int, int] | None:
    """Return which half comes first, the index of its corner d and that of corner b in the other half; None if no choice fits
    all pairs."""
    for lead in (1, 0):
        first, second = halves[lead], halves[1 - lead]
        for d in (2, 0, 1):
            for b in (1, 2, 0):
                if first[0, _FOLLOWING[d]] != second[0, _PREVIOUS[b]] or first[0, _PREVIOUS[d]] != second[0, _FOLLOWING[b]]:
                    continue
                if (first[:, _FOLLOWING[d]] == second[:, _PREVIOUS[b]]).all() and (
                    first[:, _PREVIOUS[d]] == second[:, _FOLLOWING[b]]
                ).all():
                    return lead, d, b
    return None


def _reordered(triangles: Triangles, distance: int, lead: int, d: int, b: int) -> Triangles:
    turns = ((_FOLLOWING[d], _PREVIOUS[d], d), (_PREVIOUS[b], b, _FOLLOWING[b]))

    def put(of: Ints) -> Ints:
        halves = of.reshape(-1, 2, distance, *of.shape[1:]).swapaxes(0, 1).reshape(2, -1, *of.shape[1:])
        made = np.empty((len(of) // 2, 2, *of.shape[1:]), of.dtype)
        for k, turn in enumerate(turns):
            half = halves[lead if k == 0 else 1 - lead]
            made[:, k] = half if of.ndim == 1 else half.take(turn, axis=1)
        return made.reshape(of.shape)

    return Triangles(put(triangles.points), put(triangles.corners), put(triangles.faces))
