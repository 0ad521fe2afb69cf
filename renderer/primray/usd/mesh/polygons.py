"""Polygonal meshes without materials: faces triangulated and oriented outwards, with shading normals; construction of
description.Mesh from them.

Only the length of a description.Mesh's normals and colours tells what they belong to. Where two of the counts of triangles T,
points N and corners 3T are equal, `make_mesh` expands values to the unambiguous form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats, Ints
from ...description import Interpolation, Mesh, PointMotion
from ...description import Primvar as SeamPrimvar
from ..primvars.reading import Primvar, Sizes, checked_vectors, is_per_point, per_corner
from ..scene.context import Context
from .authored import AuthoredMesh, SurfaceElements, Topology, usable_faces, without_holes
from .triangulate import Triangles, cross, paired_triangles, reversed_triangles


@dataclass(frozen=True, eq=False)
class Polygons:
    points: Floats  # (N, 3) float32, object space, scene units; as authored, but 0 where not finite
    triangles: Triangles
    normals: Values | None  # unit length; None: faceted
    sizes: Sizes  # as authored
    motion: PolygonMotion | None = None
    tets: SurfaceElements | None = None  # TetMesh only


def make_polygons(mesh: AuthoredMesh, topology: Topology, ctx: Context) -> Polygons | None:
    """Return the triangulated mesh, or None if no face has area."""
    points, triangles = _triangulated(mesh, topology, ctx)
    if len(triangles.faces) == 0:
        return None
    sizes = topology.sizes
    normals = normals_of(mesh, points, triangles, sizes, ctx)
    return Polygons(points, triangles, normals, sizes, tets=mesh.tets)


def normals_of(mesh: AuthoredMesh, points: Floats, triangles: Triangles, sizes: Sizes, ctx: Context) -> Values | None:
    normals = None if mesh.normals is None else checked_vectors(mesh.normals, sizes, mesh.path, ctx)
    return None if normals is None else shading_normals(normals, points, triangles)


def _triangulated(mesh: AuthoredMesh, topology: Topology, ctx: Context) -> tuple[Floats, Triangles]:
    """Return points and oriented triangles. Small meshes with all of their faces share both with all meshes alike."""
    faces = topology.faces
    is_shared = faces.is_shared and mesh.holes is None
    key = (topology.points.tobytes() if is_shared else b"", mesh.is_left_handed)
    if is_shared and key in faces.made:
        known: tuple[Floats, Triangles] = faces.made[key]
        return known
    points, keep = topology.points, None
    found = None if mesh.holes is not None else ctx.triangulate(points, faces.counts, faces.indices, None)
    if found is None:
        points, usable = usable_faces(topology, mesh.path, ctx, mesh.face_indices)
        keep = without_holes(usable, mesh, len(faces.counts), ctx)
        found = ctx.triangulate(points, faces.counts, faces.indices, keep)
        assert found is not None
    made, corners, of_faces, lost = found
    if lost:
        message = f"{lost} of {len(faces.counts)} faces have no area: they are left out."
        ctx.warn("faces-degenerate", mesh.path, message)
    if not is_shared or keep is not None or lost:
        return points, _oriented(Triangles(made, corners, of_faces), mesh)
    alike = ("corners", corners.tobytes(), mesh.is_left_handed)
    triangles: Triangles | None = faces.made.get(alike)
    if triangles is None:
        triangles = faces.made[alike] = _oriented(Triangles(made, corners, of_faces), mesh)
    points = np.frombuffer(key[0], points.dtype).reshape(points.shape)  # these bytes are kept in any case
    faces.made[key] = points, triangles
    return points, triangles


def _oriented(triangles: Triangles, mesh: AuthoredMesh) -> Triangles:
    return paired_triangles(reversed_triangles(triangles) if mesh.is_left_handed else triangles)


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


@dataclass(frozen=True)
class Values:
    array: Floats  # (N, 3), (T, 3) or (3T, 3)
    per: Literal["point", "face", "corner"]


@dataclass(frozen=True, eq=False)
class PolygonMotion:
    """Points and normals at the times of a motion."""

    times: Doubles  # (S + 1,) fractions of the exposure's span
    points: Floats  # (S + 1, N, 3)
    normals: tuple[Values, ...] = ()  # S + 1 of the same kind, or none if they do not change

    def of_triangles(self, keep: npt.NDArray[np.bool_]) -> PolygonMotion:
        """Return the motion with normals of a subset of triangles; `keep` is a (T,) mask."""
        kept = (values_of_triangles(values, keep) for values in self.normals)
        return replace(self, normals=tuple(values for values in kept if values is not None))

    def reordered(self, triangles: Ints) -> PolygonMotion:
        """Return the motion with points and normals per corner."""
        moved = (_to_corners(values, triangles) for values in self.normals)
        normals = tuple(values for values in moved if values is not None)
        return PolygonMotion(self.times, self.points[:, triangles.ravel()], normals)

    @property
    def at_seam(self) -> PointMotion:
        return PointMotion(self.times, self.points, np.stack([v.array for v in self.normals]) if self.normals else None)


def make_mesh(
    path: str,
    points: Floats,
    triangles: Ints,
    normals: Values | None,
    colors: Values | None,
    surface: int | Ints,
    primvars: tuple[SeamPrimvar, ...] = (),
    motion: PolygonMotion | None = None,
) -> Mesh:
    if (normals or colors) and len(points) == 3 * len(triangles):
        order = triangles.ravel()
        points = points[order]
        primvars = tuple(replace(p, values=p.values[order]) if p.interpolation is Interpolation.POINT else p for p in primvars)
        normals, colors = _to_corners(normals, triangles), _to_corners(colors, triangles)
        motion = None if motion is None else motion.reordered(triangles)
        triangles = np.arange(len(order), dtype=np.int32).reshape(-1, 3)
    if colors and len(points) == len(triangles):
        colors = _to_corners(colors, triangles)
    array_of_normals = None if normals is None else normals.array
    array_of_colors = None if colors is None else colors.array
    at_seam = None if motion is None else motion.at_seam
    return Mesh(
        path=path,
        points=points,
        triangles=triangles,
        normals=array_of_normals,
        colors=array_of_colors,
        surface=surface,
        primvars=primvars,
        motion=at_seam,
    )


def values_of_triangles(values: Values | None, keep: npt.NDArray[np.bool_]) -> Values | None:
    """Return the values of a subset of triangles; `keep` is a (T,) mask."""
    if values is None or values.per == "point":
        return values
    return Values(values.array[keep if values.per == "face" else np.repeat(keep, 3)], values.per)


def _to_corners(values: Values | None, triangles: Ints) -> Values | None:
    if values is None or values.per == "corner":
        return values
    array = values.array[triangles.ravel()] if values.per == "point" else np.repeat(values.array, 3, axis=0)
    return Values(array, "corner")
