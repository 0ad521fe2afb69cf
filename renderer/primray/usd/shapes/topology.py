"""Validated points and faces of a mesh: the common input of polygons (polygons.py) and subdivision cages (subdivision.py)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Floats, Ints
from ..scene.context import Context
from .authored_mesh import AuthoredMesh
from .primvars import Sizes

Flags = npt.NDArray[np.bool_]


LARGEST = np.float32(1e37)  # largest coordinate: sums of a few, as subdivision makes them, stay finite
SHARED_CORNERS = 1024  # meshes with more corners are rarely alike, and hashing them costs too much


@dataclass(frozen=True, eq=False)
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


class SharedFaces(dict[tuple[bytes, bytes], Faces]):
    """Faces of small meshes, keyed by their counts and indices."""


def topology_of(mesh: AuthoredMesh, ctx: Context) -> Topology | None:
    """Return points and faces if they are consistent; None if the mesh is empty or, reported, if they are not."""
    points, counts, indices = mesh.points, mesh.counts, mesh.indices
    if points is None or counts is None or indices is None:
        _note_missing(mesh, ctx)
        return None
    if len(indices) > SHARED_CORNERS:
        faces = _faces(counts, indices, mesh.path, ctx)
    else:
        key = (counts.tobytes(), indices.tobytes())
        shared = ctx.kept.of(SharedFaces)
        faces = shared.get(key) or _faces(counts, indices, mesh.path, ctx)
        if faces is not None:
            shared[key] = faces
    return None if faces is None else Topology(points, faces)


def _note_missing(mesh: AuthoredMesh, ctx: Context) -> None:
    if mesh.counts is None and mesh.indices is None and not mesh.has_points:
        ctx.warn("invalid-mesh", mesh.path, "The mesh has no points and no faces.")
        return
    parts = {"faceVertexCounts": mesh.counts, "faceVertexIndices": mesh.indices, "points": mesh.points}
    bad = [name for name, values in parts.items() if values is None]
    ctx.warn("invalid-mesh", mesh.path, f"{', '.join(bad)}: missing, or of the wrong type.", bad[0])


def _faces(counts: Ints, indices: Ints, path: str, ctx: Context) -> Faces | None:
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
    return Faces(counts, indices, low, high, least >= 3, len(indices) <= SHARED_CORNERS)


def usable_faces(topology: Topology, path: str, ctx: Context, named: str = "faceVertexIndices") -> tuple[Floats, Flags | None]:
    """Return the points, with 0 for non-finite ones, and the mask of faces that can be rendered; None instead of the mask if
    all can."""
    points, faces = topology.points, topology.faces
    in_range = faces.low >= 0 and faces.high < len(points)
    all_finite = _largest(points) <= LARGEST
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


def _largest(points: Floats) -> float:
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
