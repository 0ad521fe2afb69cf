"""Adapter for UsdGeomMesh and the surface of UsdGeomTetMesh: topology checked face by face, polygons triangulated, normals and
colours brought to triangles, surfaces assigned.

`doubleSided` has no effect: both sides of every surface are shaded, as in other path tracers.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt

from ...description import Mesh, SubdivisionMesh
from ..materials.appearance import FALLBACK_COLOR, Appearance, appearance_of, displaces, is_cut_out, make_surface
from ..primvars.reading import is_per_point, per_corner, read_display_vectors
from ..primvars.surface_primvars import mesh_primvars, primvars_of_triangles
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from .authored import read_mesh, topology_of
from .closed import is_closed, report_inside_out
from .displaced import make_displaced_mesh
from .motion import mesh_path, moving_cage, moving_polygons, with_points
from .polygons import Polygons, Values, make_mesh, make_polygons, values_of_triangles
from .subdivision import Cage, make_cage, make_subdivision_mesh
from .subsets import FaceParts, face_parts
from .tet_mesh import read_tet_mesh


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
    """Read the mesh once and return its polygons or subdivision cage, with motion."""
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
