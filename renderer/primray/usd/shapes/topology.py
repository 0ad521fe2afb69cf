"""A mesh's points and faces as authored, checked: what polygons (adapters.mesh) and cages (adapters.cage) both start from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Floats, Ints
from ..resolving.context import Context
from ..resolving.notes import note_velocities
from ..resolving.read import array, read
from ..resolving.resolve import ResolvedPrim

Flags = npt.NDArray[np.bool_]


LARGEST = np.float32(1e37)  # of a coordinate: sums of a few, as subdivision makes them, stay finite
SHARED_CORNERS = 1024  # meshes with more are rarely alike, and cost more than looking at them


@dataclass(frozen=True, eq=False)
class Faces:
    """faceVertexCounts and faceVertexIndices that fit together. Small ones are one object for all meshes that have the same:
    `made` keeps what follows from them alone."""

    counts: Ints
    indices: Ints
    low: int  # the least index
    high: int  # the greatest
    has_area: bool  # all have 3 vertices or more
    is_shared: bool
    made: dict[Any, Any] = field(default_factory=dict)


def _faces(counts: Ints, indices: Ints, prim: ResolvedPrim, ctx: Context) -> Faces | None:
    """None where they do not fit together, noted, or there are none."""
    if len(counts) == 0:
        return None
    least = int(counts.min())
    if least < 0 or int(counts.sum(dtype=np.int64)) != len(indices):
        ctx.warn(
            "invalid-mesh",
            prim.path,
            f"faceVertexCounts sum to {int(counts.sum(dtype=np.int64))}, but there are {len(indices)} faceVertexIndices.",
            "faceVertexCounts",
        )
        return None
    low, high = (int(indices.min()), int(indices.max())) if len(indices) else (0, -1)
    return Faces(counts, indices, low, high, least >= 3, len(indices) <= SHARED_CORNERS)


class _SharedFaces(dict[tuple[bytes, bytes], Faces]):
    """By content, of small meshes."""


def read_topology(prim: ResolvedPrim, ctx: Context) -> tuple[Floats, Faces] | None:
    """Points and faces where they fit together; None for an empty mesh too."""
    counts = array(read(prim.prim, "faceVertexCounts", ctx.when), 1, "i")
    indices = array(read(prim.prim, "faceVertexIndices", ctx.when), 1, "i")
    raw_points = read(prim.prim, "points", ctx.when)
    points = array(raw_points, 3, "f")
    if counts is None and indices is None and raw_points is None:
        ctx.warn("invalid-mesh", prim.path, "The mesh has no points and no faces.")
        return None
    if counts is None or indices is None or points is None:
        bad = [n for n, v in (("faceVertexCounts", counts), ("faceVertexIndices", indices), ("points", points)) if v is None]
        ctx.warn("invalid-mesh", prim.path, f"{', '.join(bad)}: missing, or of the wrong type.", bad[0])
        return None
    key = (counts.tobytes(), indices.tobytes()) if len(indices) <= SHARED_CORNERS else None
    shared = ctx.kept.of(_SharedFaces)
    faces = (shared.get(key) if key is not None else None) or _faces(counts, indices, prim, ctx)
    if faces is None:
        return None
    if key is not None:
        shared[key] = faces
    note_velocities(prim, "points", ctx)
    return points.astype(np.float32, copy=False), faces


def all_usable(points: Floats, faces: Faces) -> bool:
    return bool(faces.low >= 0 and faces.high < len(points) and faces.has_area and _largest(points) <= LARGEST)


def usable_faces(prim: ResolvedPrim, points: Floats, faces: Faces, ctx: Context) -> tuple[Floats, Flags | None]:
    """The points with 0 for those that are not finite, and the faces that can be rendered; None for all of them."""
    if all_usable(points, faces):
        return points, None
    in_range = faces.low >= 0 and faces.high < len(points)
    all_finite = _largest(points) <= LARGEST
    counts, indices = faces.counts, faces.indices
    bad_corner = (indices < 0) | (indices >= len(points))
    reasons = {} if in_range else {"faceVertexIndices": "indices out of range"}
    if not all_finite:
        finite = np.asarray((np.abs(points) <= LARGEST).all(axis=1))
        bad_corner |= ~finite[np.clip(indices, 0, len(points) - 1)]
        reasons["points"] = "points that are not finite or beyond 1e37"
        points = np.where(finite[:, None], points, np.float32(0))  # belongs to no face that is kept
    too_small = counts < 3
    if too_small.any():
        reasons["faceVertexCounts"] = "fewer than 3 vertices"
    keep = ~too_small
    keep[np.repeat(np.arange(len(counts)), counts)[bad_corner]] = False
    if not keep.all():
        message = f"{int((~keep).sum())} of {len(counts)} faces: {', '.join(reasons.values())}."
        ctx.warn("faces-dropped", prim.path, message, next(iter(reasons)))
    return points, keep


def _largest(points: Floats) -> float:
    """The largest coordinate's size; NaN where one is."""
    return max(float(points.max()), -float(points.min())) if points.size else 0.0


def hole_indices(prim: ResolvedPrim, faces: int, ctx: Context) -> Ints | None:
    if "holeIndices" not in prim.names:
        return None
    holes = array(read(prim.prim, "holeIndices", ctx.when), 1, "i")
    if holes is None or len(holes) == 0:
        return None
    inside = holes[(holes >= 0) & (holes < faces)]
    if len(inside) < len(holes):
        ctx.warn("invalid-primvar", prim.path, f"holeIndices has indices outside the {faces} faces.", "holeIndices")
    return inside


def without_holes(keep: Flags | None, prim: ResolvedPrim, faces: int, ctx: Context) -> Flags | None:
    """`keep` without the faces that holeIndices names: polygons have no other use for them."""
    holes = hole_indices(prim, faces, ctx)
    if holes is None:
        return keep
    kept = np.ones(faces, bool) if keep is None else keep
    kept[holes] = False
    return kept
