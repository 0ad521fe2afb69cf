"""Adapter for UsdGeomMesh and the surface of UsdGeomTetMesh: topology checked face by face, polygons triangulated, normals and
colours brought to triangles, surfaces assigned.

`doubleSided` has no effect: both sides of every surface are shaded, as in other path tracers.

Polygonal meshes with a displaced material become bilinear cages for the dicer: quads are kept, other faces are triangulated.
Corners and values on them are those of the polygons. Coincident points at boundary edges are welded, since displacement would
pull them apart.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Floats, Ints
from ...description import DisplacedMesh, Interpolation, Mesh, PointMotion, SubdivisionMesh
from ...description import Primvar as SeamPrimvar
from ..materials.appearance import FALLBACK_COLOR, Appearance, appearance_of, displaces, is_cut_out, make_surface
from ..primvars.reading import is_per_point, per_corner, read_display_vectors
from ..primvars.surface_primvars import mesh_primvars, primvars_of_triangles
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from .authored import is_closed, read_mesh, report_inside_out, topology_of
from .motion import mesh_path, moving_cage, moving_polygons, with_points
from .polygons import Polygons, Values, make_mesh, make_polygons, values_of_triangles
from .sources import source_of
from .subdivision import Cage, make_cage, make_subdivision_mesh
from .subsets import FaceParts, face_parts
from .tet_mesh import read_tet_mesh
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


def mesh(prim: ResolvedPrim, ctx: Context) -> Mesh | SubdivisionMesh | None:
    shared: dict[tuple[str, float], Polygons | Cage] = ctx.caches.mesh_geometries
    key = (prim.path, prim.inherited.blur_scale)
    geometry = shared.get(key) or _geometry(prim, ctx)
    if geometry is None:
        return None
    if prim.path in ctx.shares:
        shared[key] = geometry
    if isinstance(geometry, Cage):
        return make_subdivision_mesh(prim, geometry, ctx)
    if prim.subsets:
        parts = face_parts(prim, geometry.sizes.faces, ctx, geometry.tets)
        if any(displaces(parts.appearances[k]) for k in np.unique(parts.of_face[geometry.triangles.faces]).tolist()):
            return make_displaced_mesh(prim, geometry, parts, ctx)
        return _with_subsets(prim, geometry, parts, ctx)
    appearance = appearance_of(prim, prim.material, ctx)
    if displaces(appearance):
        whole = FaceParts([appearance], np.zeros(geometry.sizes.faces, np.int32))
        return make_displaced_mesh(prim, geometry, whole, ctx)
    return _shape(prim, geometry, appearance, ctx)


def _shape(prim: ResolvedPrim, geometry: Polygons, appearance: Appearance, ctx: Context) -> Mesh | None:
    if is_cut_out(appearance):
        return None
    colors = _colors(prim, geometry, ctx) if appearance.varying_color else None
    if appearance.varying_color and colors is None:
        appearance = replace(appearance, color=FALLBACK_COLOR)
    surface = make_surface(appearance, lambda: _is_closed_mesh(geometry, prim.path, ctx), prim.path, ctx)
    return make_mesh(
        prim.path,
        geometry.points,
        geometry.triangles.points,
        geometry.normals,
        colors,
        ctx.surfaces.index_of(surface),
        mesh_primvars(prim, (surface,), geometry.triangles, geometry.sizes, ctx),
        geometry.motion,
    )


def _geometry(prim: ResolvedPrim, ctx: Context) -> Polygons | Cage | None:
    """Return the mesh's polygons or subdivision cage, with motion; one object for prims with the same source."""
    source = source_of(prim, ctx)
    if source is None:
        return _read_geometry(prim, ctx)
    shared: dict[tuple[Any, ...], Polygons | Cage] = ctx.caches.source_geometries
    found, told = shared.get(source), len(ctx.diagnostics)
    if found is None:
        found = _read_geometry(prim, ctx)
        if found is not None and len(ctx.diagnostics) == told:  # what is reported is reported of each prim
            shared[source] = found
    return found


def _read_geometry(prim: ResolvedPrim, ctx: Context) -> Polygons | Cage | None:
    """Read the mesh once."""
    authored = read_tet_mesh(prim, ctx) if prim.type_name == "TetMesh" else read_mesh(prim, ctx.when)
    if authored is None:
        return None
    path = mesh_path(prim, authored, ctx)
    if path is not None:
        authored = with_points(authored, path, path.here)
    topology = topology_of(authored, ctx)
    if topology is None:
        return None
    if authored.subdivision is None:
        polygons = make_polygons(authored, topology, ctx)
        return polygons if polygons is None or path is None else moving_polygons(polygons, authored, path, ctx)
    found = make_cage(authored, authored.subdivision, topology, ctx)
    return found if found is None or path is None else moving_cage(found, path, ctx)


def _colors(prim: ResolvedPrim, geometry: Polygons, ctx: Context) -> Values | None:
    primvar = read_display_vectors(geometry.sizes, prim, ctx)
    if primvar is None:
        return None
    if primvar.interpolation == "uniform":
        return Values(primvar.values[geometry.triangles.faces], "face")
    if is_per_point(primvar):
        return Values(primvar.values, "point")
    return Values(per_corner(primvar, geometry.triangles), "corner")


def _with_subsets(prim: ResolvedPrim, geometry: Polygons, found: FaceParts, ctx: Context) -> Mesh | None:
    """Return a mesh with one surface per triangle, from the prim's material-bind subsets."""
    parts = found.appearances
    of_triangle = found.of_face[geometry.triangles.faces]
    hidden = np.array([is_cut_out(part) for part in parts])
    visible = np.logical_not(np.take(hidden, of_triangle))
    if not visible.any():
        return None
    used = np.unique(of_triangle[visible])
    is_body = cache(lambda: _is_closed_mesh(geometry, prim.path, ctx))
    surfaces = {int(part): make_surface(parts[part], is_body, prim.path, ctx) for part in used}
    index_of_part = np.full(len(parts), -1, np.int32)
    for part, surface in surfaces.items():
        index_of_part[part] = ctx.surfaces.index_of(surface)
    colors = _subset_colors(prim, geometry, np.array([part.varying_color for part in parts])[of_triangle], visible, ctx)
    return make_mesh(
        prim.path,
        geometry.points,
        geometry.triangles.points[visible],
        values_of_triangles(geometry.normals, visible),
        values_of_triangles(colors, visible),
        index_of_part[of_triangle[visible]],
        primvars_of_triangles(mesh_primvars(prim, surfaces.values(), geometry.triangles, geometry.sizes, ctx), visible),
        geometry.motion and geometry.motion.of_triangles(visible),
    )


def _subset_colors(
    prim: ResolvedPrim,
    geometry: Polygons,
    varying: npt.NDArray[np.bool_],
    visible: npt.NDArray[np.bool_],
    ctx: Context,
) -> Values | None:
    """Return a colour per corner: displayColor on triangles whose surface reads it (`varying`, (T,)), white on those whose
    material has its own colour."""
    if not (varying & visible).any():
        return None
    primvar = read_display_vectors(geometry.sizes, prim, ctx)
    if primvar is None:
        return None
    colors = per_corner(primvar, geometry.triangles).copy()
    colors[np.repeat(~varying, 3)] = 1.0
    return Values(colors, "corner")


def _is_closed_mesh(geometry: Polygons, path: str, ctx: Context) -> bool:
    """Return whether the mesh is closed, so that light can enter it. Reports meshes whose faces point inwards."""
    points, triangles = geometry.points, geometry.triangles.points
    if not is_closed(points, triangles):
        return False
    report_inside_out(points, triangles, path, ctx)
    return True
