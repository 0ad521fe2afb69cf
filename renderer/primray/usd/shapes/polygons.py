"""Polygonal mesh without materials: faces triangulated and oriented outwards, with their normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Floats, Ints
from ..scene.context import Context
from .authored_mesh import AuthoredMesh, Owned
from .normals import shading_normals
from .pairs import paired
from .primvars import Sizes, checked_vectors
from .seam_mesh import PolygonMotion, Values
from .topology import Faces, Flags, Topology, usable_faces, without_holes
from .triangulate import Fan, Triangles, fan_of, flipped, triangulate


@dataclass(frozen=True, eq=False)
class Polygons:
    points: Floats  # (N, 3) float32, object space, scene units; as authored, but 0 where not finite
    triangles: Triangles
    normals: Values | None  # unit length; None: faceted
    sizes: Sizes  # as authored
    motion: PolygonMotion | None = None
    tets: Owned | None = None  # TetMesh only


def make_polygons(mesh: AuthoredMesh, topology: Topology, ctx: Context) -> Polygons | None:
    """Return the triangulated mesh, or None if no face has area."""
    points, triangles = _triangulated(mesh, topology, ctx)
    if len(triangles.faces) == 0:
        return None
    triangles = paired(flipped(triangles) if mesh.is_left_handed else triangles)
    sizes = topology.sizes
    normals = normals_of(mesh, points, triangles, sizes, ctx)
    return Polygons(points, triangles, normals, sizes, tets=mesh.tets)


def normals_of(mesh: AuthoredMesh, points: Floats, triangles: Triangles, sizes: Sizes, ctx: Context) -> Values | None:
    normals = None if mesh.normals is None else checked_vectors(mesh.normals, sizes, mesh.path, ctx)
    return None if normals is None else shading_normals(normals, points, triangles)


def _triangulated(mesh: AuthoredMesh, topology: Topology, ctx: Context) -> tuple[Floats, Triangles]:
    """Return points and triangles. Small meshes that are simple fans share one object with all meshes alike."""
    faces = topology.faces
    fan = _fan(faces) if mesh.holes is None else None
    key = b"" if fan is None else topology.points.tobytes()
    if fan is not None and key in faces.made:
        return faces.made[key], fan.triangles
    points, usable = usable_faces(topology, mesh.path, ctx, mesh.face_indices)
    if fan is not None and usable is None and fan.fits(points):
        faces.made[key] = np.frombuffer(key, points.dtype).reshape(points.shape)  # these bytes are kept in any case
        return faces.made[key], fan.triangles
    keep = without_holes(usable, mesh, len(faces.counts), ctx)
    triangles = triangulate(points, faces.counts, faces.indices, keep)
    _note_degenerate(mesh.path, keep, triangles, faces.counts, ctx)
    return points, triangles


def _fan(faces: Faces) -> Fan | None:
    """Return the faces as a triangle fan, or None; computed once for all meshes that share the faces."""
    if not faces.is_shared:
        return None
    if "fan" not in faces.made:
        faces.made["fan"] = fan_of(faces.counts, faces.indices)
    found: Fan | None = faces.made["fan"]
    return found


def _note_degenerate(path: str, keep: Flags | None, triangles: Triangles, counts: Ints, ctx: Context) -> None:
    """Report how many faces have no area at all; degenerate triangles within a face are not reported."""
    wanted = len(counts) if keep is None else int(keep.sum())
    if len(triangles.faces) >= int((counts if keep is None else counts[keep]).sum()) - 2 * wanted:
        return
    lost = wanted - len(np.unique(triangles.faces))
    if lost:
        ctx.warn("faces-degenerate", path, f"{lost} of {len(counts)} faces have no area: they are left out.")
