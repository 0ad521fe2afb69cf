"""UsdGeomMesh to triangles: topology checked face by face, normals and colours brought to triangles, surfaces assigned.

`doubleSided` has no effect: both sides of every surface shade, as in other path tracers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ...description import Floats, Ints, Mesh
from ..context import Context
from ..normals import read_normals, shading_normals
from ..notes import note_velocities
from ..primvars import Sizes, is_per_point, per_corner, read_primvar
from ..read import array, read, token
from ..resolve import ResolvedPrim
from ..seam_mesh import Values, keep_triangles, seam_mesh
from ..surface_primvars import mesh_primvars, moved
from ..triangulate import Triangles, flipped, triangulate
from .surface import FALLBACK_COLOR, Appearance, appearance_of, is_hidden, make_surface


@dataclass(frozen=True)
class Geometry:
    """What does not depend on materials: shared by the prototypes that hold the same prim."""

    points: Floats
    triangles: Triangles
    normals: Values | None
    sizes: Sizes


def mesh(prim: ResolvedPrim, ctx: Context) -> Mesh | None:
    geometry = ctx.shared_geometry.get(prim.path) or _geometry(prim, ctx)
    if geometry is None:
        return None
    if prim.path in ctx.shares:
        ctx.shared_geometry[prim.path] = geometry
    appearance = appearance_of(prim, prim.material, ctx)
    if prim.subsets:
        return _with_subsets(prim, geometry, appearance, ctx)
    return _shape(prim, geometry, appearance, ctx)


def _shape(prim: ResolvedPrim, geometry: Geometry, appearance: Appearance, ctx: Context) -> Mesh | None:
    if is_hidden(appearance):
        return None
    colors = _colors(prim, geometry, ctx) if appearance.varying_color else None
    if appearance.varying_color and colors is None:
        appearance = replace(appearance, color=FALLBACK_COLOR)
    surface = make_surface(appearance, lambda: is_closed(geometry.points, geometry.triangles.points))
    return seam_mesh(
        prim.path,
        geometry.points,
        geometry.triangles.points,
        geometry.normals,
        colors,
        ctx.surface_index(surface),
        mesh_primvars(prim, (surface,), geometry.triangles, geometry.sizes, ctx),
    )


def _geometry(prim: ResolvedPrim, ctx: Context) -> Geometry | None:
    counts = array(read(prim.prim, "faceVertexCounts", ctx.when), 1, "i")
    indices = array(read(prim.prim, "faceVertexIndices", ctx.when), 1, "i")
    raw_points = read(prim.prim, "points", ctx.when)
    points = array(raw_points, 3, "f")
    if counts is None and indices is None and raw_points is None:
        ctx.warn("invalid-mesh", prim.path, "The mesh has no points and no faces.")
        return None
    if counts is None or indices is None or points is None:
        bad = [n for n, v in (("faceVertexCounts", counts), ("faceVertexIndices", indices), ("points", points)) if v is None]
        ctx.warn("invalid-mesh", prim.path, f"{', '.join(bad)}: missing, or of the wrong type.")
        return None
    if len(counts) == 0:
        return None
    if counts.min() < 0 or int(counts.sum(dtype=np.int64)) != len(indices):
        ctx.warn(
            "invalid-mesh",
            prim.path,
            f"faceVertexCounts sum to {int(counts.sum(dtype=np.int64))}, but there are {len(indices)} faceVertexIndices.",
        )
        return None
    note_velocities(prim, "points", ctx)
    points = points.astype(np.float32)
    keep = _usable_faces(prim, points, counts, indices, ctx)
    triangles = triangulate(points, counts, indices, keep)
    sizes = Sizes(len(counts), len(points), len(indices))
    _note_degenerate(prim, keep, sizes.faces, triangles, counts, ctx)
    if len(triangles.faces) == 0:
        return None
    if "orientation" in prim.names and token(prim.prim, "orientation", ctx.when, "rightHanded") == "leftHanded":
        triangles = flipped(triangles)
    return Geometry(points, triangles, _normals(prim, points, triangles, sizes, ctx), sizes)


def _usable_faces(
    prim: ResolvedPrim, points: Floats, counts: Ints, indices: Ints, ctx: Context
) -> npt.NDArray[np.bool_] | None:
    """The faces that can be rendered; None for all of them."""
    bad_corner = (indices < 0) | (indices >= len(points))
    reasons = ["indices out of range"] if bad_corner.any() else []
    finite = np.asarray(np.isfinite(points).all(axis=1))
    if not finite.all() and len(points):
        bad_corner |= ~finite[np.clip(indices, 0, len(points) - 1)]
        reasons.append("points that are not finite")
        points[~finite] = 0.0  # belongs to no face that is kept
    too_small = counts < 3
    if too_small.any():
        reasons.append("fewer than 3 vertices")
    holes = _holes(prim, len(counts), ctx)
    if not reasons and holes is None:
        return None
    keep = ~too_small
    keep[np.repeat(np.arange(len(counts)), counts)[bad_corner]] = False
    if not keep.all() and reasons:
        ctx.warn("faces-dropped", prim.path, f"{int((~keep).sum())} of {len(counts)} faces: {', '.join(reasons)}.")
    if holes is not None:
        keep[holes] = False
    return keep


def _holes(prim: ResolvedPrim, faces: int, ctx: Context) -> Ints | None:
    if "holeIndices" not in prim.names:
        return None
    holes = array(read(prim.prim, "holeIndices", ctx.when), 1, "i")
    if holes is None or len(holes) == 0:
        return None
    inside = holes[(holes >= 0) & (holes < faces)]
    if len(inside) < len(holes):
        ctx.warn("invalid-primvar", prim.path, f"holeIndices has indices outside the {faces} faces.")
    return inside


def _note_degenerate(
    prim: ResolvedPrim,
    keep: npt.NDArray[np.bool_] | None,
    faces: int,
    triangles: Triangles,
    counts: Ints,
    ctx: Context,
) -> None:
    """Say how many faces vanished altogether; triangles without area inside a face need no word."""
    wanted = faces if keep is None else int(keep.sum())
    if len(triangles.faces) >= int((counts if keep is None else counts[keep]).sum()) - 2 * wanted:
        return
    lost = wanted - len(np.unique(triangles.faces))
    if lost:
        ctx.warn("faces-degenerate", prim.path, f"{lost} of {faces} faces have no area.")


def _normals(prim: ResolvedPrim, points: Floats, triangles: Triangles, sizes: Sizes, ctx: Context) -> Values | None:
    """None where the mesh is to look faceted: polygonal without normals, or a cage (whose authored normals do not count)."""
    scheme = token(prim.prim, "subdivisionScheme", ctx.when, "catmullClark")
    if scheme != "none":
        ctx.warn("subdivision-cage", prim.path, f"subdivisionScheme = {scheme}.")
        return None
    normals = read_normals(prim, sizes, ctx)
    return None if normals is None else shading_normals(normals, points, triangles)


def _colors(prim: ResolvedPrim, geometry: Geometry, ctx: Context) -> Values | None:
    primvar = read_primvar(prim.prim.GetAttribute("primvars:displayColor"), geometry.sizes, prim, ctx)
    if primvar is None:
        return None
    if primvar.interpolation == "uniform":
        return Values(primvar.values[geometry.triangles.faces], "face")
    if is_per_point(primvar):
        return Values(primvar.values, "point")
    return Values(per_corner(primvar, geometry.triangles), "corner")


def _with_subsets(prim: ResolvedPrim, geometry: Geometry, rest: Appearance, ctx: Context) -> Mesh | None:
    """A surface per triangle; faces that no subset holds keep the mesh's own."""
    faces = np.zeros(geometry.sizes.faces, np.int32)  # 0: the mesh's own, k: subset k
    families: list[str | None] = [None]  # of each part; the mesh's own is in none
    parts = [rest]
    for subset in prim.subsets:
        indices = array(read(subset.prim, "indices", ctx.when), 1, "i")
        if indices is None or (len(indices) and (indices.min() < 0 or indices.max() >= len(faces))):
            ctx.warn("subset-ignored", subset.path, f"Its indices are not faces of the mesh, which has {len(faces)}.")
            continue
        held = np.array([family == subset.family for family in families])[faces[indices]]
        if held.any():
            ctx.warn("subset-overlap", subset.path, f"{int(held.sum())} of its faces are in another subset of its family.")
        families.append(subset.family)
        faces[indices] = len(parts)
        parts.append(appearance_of(prim, subset.material, ctx))
    _note_incomplete(prim, faces, ctx)
    of_triangle = faces[geometry.triangles.faces]
    hidden = np.array([is_hidden(part) for part in parts])
    visible = np.logical_not(np.take(hidden, of_triangle))
    if not visible.any():
        return None
    closed = is_closed(geometry.points, geometry.triangles.points)
    used = np.unique(of_triangle[visible])
    surfaces = {int(part): make_surface(parts[part], lambda: closed) for part in used}
    index_of_part = np.full(len(parts), -1, np.int32)
    for part, surface in surfaces.items():
        index_of_part[part] = ctx.surface_index(surface)
    colors = _subset_colors(prim, geometry, np.array([part.varying_color for part in parts])[of_triangle], visible, ctx)
    return seam_mesh(
        prim.path,
        geometry.points,
        geometry.triangles.points[visible],
        keep_triangles(geometry.normals, visible),
        keep_triangles(colors, visible),
        index_of_part[of_triangle[visible]],
        moved(mesh_primvars(prim, surfaces.values(), geometry.triangles, geometry.sizes, ctx), visible),
    )


def _note_incomplete(prim: ResolvedPrim, faces: Ints, ctx: Context) -> None:
    name = "subsetFamily:materialBind:familyType"
    if name in prim.names and token(prim.prim, name, ctx.when, "") == "partition" and not faces.all():
        rest = int(np.count_nonzero(faces == 0))
        ctx.warn("subset-incomplete", prim.path, f"{rest} faces are in none, though {name} is partition.")


def _subset_colors(
    prim: ResolvedPrim,
    geometry: Geometry,
    varying: npt.NDArray[np.bool_],
    visible: npt.NDArray[np.bool_],
    ctx: Context,
) -> Values | None:
    """Per corner: displayColor on triangles whose surface takes it (`varying`, (T,)), 1 on those with a colour of their own."""
    if not (varying & visible).any():
        return None
    primvar = read_primvar(prim.prim.GetAttribute("primvars:displayColor"), geometry.sizes, prim, ctx)
    if primvar is None:
        return None
    colors = per_corner(primvar, geometry.triangles).copy()
    colors[np.repeat(~varying, 3)] = 1.0
    return Values(colors, "corner")


def is_closed(points: Floats, triangles: Ints) -> bool:
    """Whether every edge is shared by exactly two triangles that run along it in opposite directions (a 2-manifold).

    Points at the same place are one, so that meshes with split vertices count as closed.
    """
    _, welded = np.unique(points, axis=0, return_inverse=True)
    t = welded.reshape(-1)[triangles].astype(np.int64)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    if len(edges) == 0:
        return False
    size = int(edges.max()) + 1
    forward = np.sort(edges[:, 0] * size + edges[:, 1])
    backward = np.sort(edges[:, 1] * size + edges[:, 0])
    return bool((forward[1:] != forward[:-1]).all() and (forward == backward).all())
