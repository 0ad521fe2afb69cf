"""Polygonal meshes with a displaced material as bilinear cages for the dicer: quads are kept, other faces are triangulated.

Corners and values on them are those of the polygons. Coincident points at boundary edges are welded, since displacement would
pull them apart.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Floats, Ints
from ...description import DisplacedMesh, Interpolation, PointMotion, SubdivisionMesh
from ...description import Primvar as SeamPrimvar
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from .polygons import Polygons, Values
from .subdivision import Cage, make_subdivision_mesh
from .subsets import FaceParts
from .triangulate import quad_bends


def bilinear_cage(polygons: Polygons) -> tuple[Cage, SeamPrimvar | None]:
    """Return the cage and the normals along which it is displaced, or None for the faces' own normals."""
    triangles = polygons.triangles
    counts, rows = _quads_and_triangles(polygons)
    face_points = triangles.points.ravel()[rows].astype(np.int32)
    first = rows[np.cumsum(counts) - counts]
    motion = polygons.motion
    found = Cage(
        points=polygons.points,
        face_counts=counts,
        face_points=face_points,
        faces=triangles.faces[first // 3],
        corners=triangles.corners.ravel()[rows].astype(np.int32),
        sizes=polygons.sizes,
        holes=None,
        creases=None,
        corner_points=None,
        corner_sharpnesses=None,
        scheme="bilinear",
        boundary="edgeAndCorner",
        face_varying="all",
        triangle_rule="catmullClark",
        motion=None if motion is None else PointMotion(motion.times, motion.points),
    )
    if polygons.normals is None:
        return found, None
    times = [polygons.normals, *(motion.normals if motion is not None else ())]
    columns = [_values_by_corner(values, face_points, rows) for values in times]
    return found, SeamPrimvar("", Interpolation.CORNER, np.ascontiguousarray(np.concatenate(columns, axis=1), np.float32))


def _values_by_corner(values: Values, face_points: Ints, rows: Ints) -> Floats:
    of_values: Ints = {"point": face_points, "corner": rows, "face": rows // 3}[values.per]
    return np.asarray(values.array[of_values], np.float32)


def _quads_and_triangles(polygons: Polygons) -> tuple[Ints, Ints]:
    """Return the number of corners of each face (F,), and for each of these corners its index among the triangles' corners."""
    points, faces = polygons.triangles.points, polygons.triangles.faces
    of_face = np.bincount(faces)[faces] if len(faces) else faces
    first = np.flatnonzero((of_face[:-1] == 2) & (faces[:-1] == faces[1:]))
    a, b = points[first], points[first + 1]
    alone_a = (a[:, :, None] != b[:, None, :]).all(axis=2)
    alone_b = (b[:, :, None] != a[:, None, :]).all(axis=2)
    whole = (alone_a.sum(axis=1) == 1) & (alone_b.sum(axis=1) == 1)
    first, at, across = first[whole], alone_a[whole].argmax(axis=1), alone_b[whole].argmax(axis=1)
    start = 3 * first
    quads = np.stack([start + at, start + (at + 1) % 3, start + 3 + across, start + (at + 2) % 3], axis=1)
    corners = polygons.points[points.ravel()[quads]].astype(np.float64)
    flat = ~quad_bends(corners).any(axis=1) if len(quads) else np.zeros(0, bool)
    first, quads = first[flat], quads[flat]
    rows = np.concatenate([np.arange(3 * len(points)).reshape(-1, 3), np.full((len(points), 1), -1)], axis=1)
    rows[first] = quads
    keep = np.ones(len(points), bool)
    keep[first + 1] = False
    rows = rows[keep]
    counts = (rows >= 0).sum(axis=1).astype(np.int32)
    return counts, rows[rows >= 0].astype(np.int32)


def with_welded_points(mesh: DisplacedMesh) -> DisplacedMesh:
    """Return the mesh with coincident boundary points merged."""
    joined = _welded_points(mesh)
    if joined is None:
        return mesh
    before = mesh.face_points

    def by_corner(primvar: SeamPrimvar) -> SeamPrimvar:
        if primvar.interpolation not in (Interpolation.POINT, Interpolation.VARYING):
            return primvar
        indices = before if primvar.indices is None else primvar.indices[before]
        return SeamPrimvar(primvar.name, Interpolation.CORNER, primvar.values, indices)

    return replace(
        mesh,
        face_points=joined,
        colors=None if mesh.colors is None else by_corner(mesh.colors),
        primvars=tuple(by_corner(primvar) for primvar in mesh.primvars),
    )


def _welded_points(mesh: DisplacedMesh) -> Ints | None:
    """Return the merged point indices of the faces; None if no points coincide or a face would have the same point twice."""
    start = np.cumsum(mesh.face_counts) - mesh.face_counts
    following = np.arange(1, len(mesh.face_points) + 1)
    following[start + mesh.face_counts - 1] = start
    a = mesh.face_points.astype(np.int64)
    b = a[following]
    size = len(mesh.points)
    _, edge, uses = np.unique(np.minimum(a, b) * size + np.maximum(a, b), return_inverse=True, return_counts=True)
    ends = uses[edge.reshape(-1)] == 1
    boundary = np.unique(np.concatenate([a[ends], b[ends]]))
    if len(boundary) == 0:
        return None
    steps = mesh.points[None] if mesh.motion is None else np.concatenate([mesh.points[None], mesh.motion.points])
    places = steps[:, boundary].transpose(1, 0, 2).reshape(len(boundary), -1) + np.float32(0)
    _, where, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
    if len(where) == len(boundary):
        return None
    to = np.arange(size)
    to[boundary] = boundary[where[place.reshape(-1)]]
    joined = to[mesh.face_points].astype(np.int32)
    face = np.repeat(np.arange(len(mesh.face_counts)), mesh.face_counts)
    order = np.lexsort((joined, face))
    again = (joined[order[1:]] == joined[order[:-1]]) & (face[order[1:]] == face[order[:-1]])
    return None if again.any() else joined


def make_displaced_mesh(prim: ResolvedPrim, geometry: Polygons, parts: FaceParts, ctx: Context) -> SubdivisionMesh | None:
    found, normals = bilinear_cage(geometry)
    made = make_subdivision_mesh(prim, found, ctx, parts)
    return with_welded_points(replace(made, normals=normals)) if isinstance(made, DisplacedMesh) else made
