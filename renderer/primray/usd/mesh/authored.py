"""Authored data of a Mesh prim, and its validated topology: the common input of polygons (polygons.py) and subdivision cages
(subdivision.py).

`read_mesh` is the one place where the geometric attributes of meshes are read from USD; it checks only types: a value that is
missing or has the wrong type is None (or "" for tokens). `topology_of` and `usable_faces` validate points and faces, and report
what is dropped.

Light can enter a closed mesh. One whose faces point inwards is reported: its interior is everything outside. Mirroring
transforms do not matter: USD defines orientation in the shape's own space, where the volume is measured.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from pxr import UsdGeom

from ...arrays import Floats, Ints
from ..primvars.reading import AuthoredPrimvar, Sizes, read_authored
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.reads import normals_interpolation
from ..stage.values import When, array, read, token, value
from .triangulate import LARGEST


@dataclass(frozen=True, eq=False, kw_only=True)
class AuthoredSubdivision:
    """Attributes that only subdivision surfaces use; point indices are as authored."""

    boundary: str = ""  # interpolateBoundary
    face_varying: str = ""  # faceVaryingLinearInterpolation
    triangle_rule: str = ""  # triangleSubdivisionRule
    crease_lengths: Ints | None = None  # (K,) int32, the number of points of each crease
    crease_points: Ints | None = None  # int32, concatenated over creases
    crease_sharpnesses: Floats | None = None  # one per crease, or one per edge; 0 smooth, 10 sharp
    corner_points: Ints | None = None  # (S,) int32
    corner_sharpnesses: Floats | None = None  # (S,), 0 smooth, 10 sharp


_NAMES = """interpolateBoundary faceVaryingLinearInterpolation triangleSubdivisionRule
    creaseLengths creaseIndices creaseSharpnesses cornerIndices cornerSharpnesses"""
_SUBDIVISION = frozenset(_NAMES.split())
_NO_SUBDIVISION = AuthoredSubdivision()  # shared by all meshes without such attributes


class SurfaceElements(Protocol):
    """Elements whose outer faces form a surface, such as tetrahedra."""

    @property
    def points(self) -> Ints:
        """Vertex indices, one row per element."""

    def owners(self) -> Ints:
        """Return the element (F,) that each surface face belongs to, or -1."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AuthoredMesh:
    path: str
    points: Floats | None  # (N, 3) float32, object space, scene units
    has_points: bool  # true even if they have the wrong type
    counts: Ints | None  # (F,) the number of corners of each face
    indices: Ints | None  # (C,) the point at each corner
    holes: Ints | None  # (H,) indices of faces
    is_left_handed: bool
    scheme: str  # subdivisionScheme
    normals: AuthoredPrimvar | None  # polygons only: limit surfaces have their own
    subdivision: AuthoredSubdivision | None  # None for polygons
    face_indices: str = "faceVertexIndices"  # attribute that `indices` come from
    tets: SurfaceElements | None = None  # TetMesh only


def read_mesh(prim: ResolvedPrim, when: When) -> AuthoredMesh:
    scheme = _token(prim, "subdivisionScheme", when)
    counts = array(read(prim.prim, "faceVertexCounts", when), 1, "i")
    indices = array(read(prim.prim, "faceVertexIndices", when), 1, "i")
    points = read(prim.prim, "points", when)
    return AuthoredMesh(
        path=prim.path,
        points=_points(points),
        has_points=points is not None,
        counts=counts,
        indices=indices,
        holes=_array(prim, "holeIndices", when, "i"),
        is_left_handed=_token(prim, "orientation", when) == "leftHanded",
        scheme=scheme,
        normals=read_normals(prim, when) if scheme == "none" else None,
        subdivision=None if scheme == "none" else _subdivision(prim, when),
    )


def _points(raw: object) -> Floats | None:
    points = array(raw, 3, "f")
    return None if points is None else points.astype(np.float32, copy=False)


def read_normals(prim: ResolvedPrim, when: When) -> AuthoredPrimvar | None:
    """Return `primvars:normals` if it has a value, else `normals` (UsdGeomMesh, UsdGeomPointBased::GetNormalsAttr)."""
    if "primvars:normals" in prim.names:
        attribute = prim.prim.GetAttribute("primvars:normals")
        if attribute.HasAuthoredValue():
            return read_authored(attribute, when)
    raw = value(prim.prim.GetAttribute("normals"), when) if "normals" in prim.names else None
    if raw is None or (hasattr(raw, "__len__") and len(raw) == 0):
        return None
    return AuthoredPrimvar("normals", raw, normals_interpolation(UsdGeom.PointBased(prim.prim)))


def _subdivision(prim: ResolvedPrim, when: When) -> AuthoredSubdivision:
    if prim.names.isdisjoint(_SUBDIVISION):
        return _NO_SUBDIVISION
    return AuthoredSubdivision(
        boundary=_token(prim, "interpolateBoundary", when),
        face_varying=_token(prim, "faceVaryingLinearInterpolation", when),
        triangle_rule=_token(prim, "triangleSubdivisionRule", when),
        crease_lengths=_integers(prim, "creaseLengths", when),
        crease_points=_integers(prim, "creaseIndices", when),
        crease_sharpnesses=_array(prim, "creaseSharpnesses", when, "f"),
        corner_points=_integers(prim, "cornerIndices", when),
        corner_sharpnesses=_array(prim, "cornerSharpnesses", when, "f"),
    )


def _token(prim: ResolvedPrim, name: str, when: When) -> str:
    return token(prim.prim, name, when, "") if name in prim.names else ""


def _array(prim: ResolvedPrim, name: str, when: When, kind: str) -> npt.NDArray[Any] | None:
    return array(read(prim.prim, name, when), 1, kind) if name in prim.names else None


def _integers(prim: ResolvedPrim, name: str, when: When) -> Ints | None:
    values = _array(prim, name, when, "i")
    return None if values is None else values.astype(np.int32)


Flags = npt.NDArray[np.bool_]


SHARED_CORNERS = 1024  # meshes with more corners are rarely alike, and hashing them costs too much


@dataclass(frozen=True, eq=False, kw_only=True)
class Faces:
    """Consistent faceVertexCounts and faceVertexIndices. Small ones are one object for all meshes with the same faces; `made`
    caches what is derived from the faces alone."""

    counts: Ints
    indices: Ints
    low: int  # smallest index
    high: int  # largest index
    has_area: bool  # all faces have at least 3 vertices
    is_shared: bool
    made: dict[Any, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Topology:
    points: Floats  # (N, 3) float32, object space, scene units; as authored
    faces: Faces

    @property
    def sizes(self) -> Sizes:
        return Sizes(len(self.faces.counts), len(self.points), len(self.faces.indices))


def topology_of(mesh: AuthoredMesh, ctx: Context) -> Topology | None:
    """Return points and faces if they are consistent; None if the mesh is empty or, reported, if they are not."""
    points, counts, indices = mesh.points, mesh.counts, mesh.indices
    if points is None or counts is None or indices is None:
        _report_missing(mesh, ctx)
        return None
    if len(indices) > SHARED_CORNERS:
        faces = _checked_faces(counts, indices, mesh.path, ctx)
    else:
        key = (counts.tobytes(), indices.tobytes())
        shared: dict[tuple[bytes, bytes], Faces] = ctx.caches.faces
        faces = shared.get(key) or _checked_faces(counts, indices, mesh.path, ctx)
        if faces is not None:
            shared[key] = faces
    return None if faces is None else Topology(points, faces)


def _report_missing(mesh: AuthoredMesh, ctx: Context) -> None:
    if mesh.counts is None and mesh.indices is None and not mesh.has_points:
        ctx.warn("invalid-mesh", mesh.path, "The mesh has no points and no faces.")
        return
    parts = {"faceVertexCounts": mesh.counts, "faceVertexIndices": mesh.indices, "points": mesh.points}
    bad = [name for name, values in parts.items() if values is None]
    ctx.warn("invalid-mesh", mesh.path, f"{', '.join(bad)}: missing, or of the wrong type.", bad[0])


def _checked_faces(counts: Ints, indices: Ints, path: str, ctx: Context) -> Faces | None:
    """Return the faces; None if there are none or, reported, if counts and indices disagree."""
    if len(counts) == 0:
        return None
    least = int(counts.min())
    if least < 0 or int(counts.sum(dtype=np.int64)) != len(indices):
        ctx.warn(
            "invalid-mesh",
            path,
            f"faceVertexCounts sum to {int(counts.sum(dtype=np.int64))}, but there are {len(indices)} faceVertexIndices.",
            "faceVertexCounts",
        )
        return None
    low, high = (int(indices.min()), int(indices.max())) if len(indices) else (0, -1)
    return Faces(
        counts=counts, indices=indices, low=low, high=high, has_area=least >= 3, is_shared=len(indices) <= SHARED_CORNERS
    )


def usable_faces(topology: Topology, path: str, ctx: Context, named: str = "faceVertexIndices") -> tuple[Floats, Flags | None]:
    """Return the points, with 0 for non-finite ones, and the mask of faces that can be rendered; None instead of the mask if
    all can."""
    points, faces = topology.points, topology.faces
    in_range = faces.low >= 0 and faces.high < len(points)
    all_finite = _largest_coordinate(points) <= LARGEST
    if in_range and all_finite and faces.has_area:
        return points, None
    counts, indices = faces.counts, faces.indices
    bad_corner = (indices < 0) | (indices >= len(points))
    reasons = {} if in_range else {named: "indices out of range"}
    if not all_finite:
        finite = np.asarray((np.abs(points) <= LARGEST).all(axis=1))
        bad_corner |= ~finite[np.clip(indices, 0, len(points) - 1)]
        reasons["points"] = "points that are not finite or beyond 1e37"
        points = np.where(finite[:, None], points, np.float32(0))  # used only by faces that are dropped
    too_small = counts < 3
    if too_small.any():
        reasons["faceVertexCounts"] = "fewer than 3 vertices"
    keep = ~too_small
    keep[np.repeat(np.arange(len(counts)), counts)[bad_corner]] = False
    if not keep.all():
        message = f"{int((~keep).sum())} of {len(counts)} faces are left out: {', '.join(reasons.values())}."
        ctx.warn("faces-dropped", path, message, next(iter(reasons)))
    return points, keep


def _largest_coordinate(points: Floats) -> float:
    """Return the largest absolute coordinate, or NaN if any is NaN."""
    return max(float(points.max()), -float(points.min())) if points.size else 0.0


def hole_indices(mesh: AuthoredMesh, faces: int, ctx: Context) -> Ints | None:
    """Return the indices in holeIndices that are in range; None if none are authored."""
    holes = mesh.holes
    if holes is None or len(holes) == 0:
        return None
    inside = holes[(holes >= 0) & (holes < faces)]
    if len(inside) < len(holes):
        ctx.warn(
            "invalid-primvar",
            mesh.path,
            f"holeIndices has indices outside the {faces} faces: these are ignored.",
            "holeIndices",
        )
    return inside


def without_holes(keep: Flags | None, mesh: AuthoredMesh, faces: int, ctx: Context) -> Flags | None:
    """Return the mask `keep` without the faces in holeIndices, which polygons simply leave out."""
    holes = hole_indices(mesh, faces, ctx)
    if holes is None:
        return keep
    kept = np.ones(faces, bool) if keep is None else keep
    kept[holes] = False
    return kept


def is_closed(points: Floats, triangles: Ints) -> bool:
    """Return whether every edge is shared by exactly two triangles that traverse it in opposite directions (a closed
    2-manifold).

    Coincident points count as one, so that meshes with split vertices count as closed.
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


def report_inside_out(points: Floats, triangles: Ints, path: str, ctx: Context) -> None:
    """Report closed triangles that run clockwise seen from outside, recognised by a negative enclosed volume."""
    corners = points[triangles].astype(np.float64) - points[triangles[0, 0]]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
    if volume < 0:
        message = "It transmits light, but its faces point inwards: everything outside counts as its interior."
        ctx.warn("inside-out", path, message, "orientation")


def triangle_fans(face_counts: Ints, face_points: Ints) -> Ints:
    """Return triangle fans (T, 3) of polygons, from the first corner of each."""
    start, count = np.cumsum(face_counts) - face_counts, np.maximum(face_counts - 2, 0)
    first = np.repeat(start, count)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([face_points[first], face_points[second], face_points[second + 1]], axis=1)
