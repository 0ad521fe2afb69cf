"""A mesh's points and faces as authored, checked: what polygons (adapters.mesh) and cages (adapters.cage) both start from."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..description import Floats, Ints
from .context import Context
from .notes import note_velocities
from .read import array, read
from .resolve import ResolvedPrim

Flags = npt.NDArray[np.bool_]


def read_topology(prim: ResolvedPrim, ctx: Context) -> tuple[Floats, Ints, Ints] | None:
    """Points, faceVertexCounts and faceVertexIndices where they fit together; None for an empty mesh too."""
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
    return points.astype(np.float32), counts, indices


def usable_faces(prim: ResolvedPrim, points: Floats, counts: Ints, indices: Ints, ctx: Context) -> Flags | None:
    """The faces that can be rendered; None for all of them. Points that are not finite are set to 0."""
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
    if not reasons:
        return None
    keep = ~too_small
    keep[np.repeat(np.arange(len(counts)), counts)[bad_corner]] = False
    if not keep.all():
        ctx.warn("faces-dropped", prim.path, f"{int((~keep).sum())} of {len(counts)} faces: {', '.join(reasons)}.")
    return keep


def hole_indices(prim: ResolvedPrim, faces: int, ctx: Context) -> Ints | None:
    if "holeIndices" not in prim.names:
        return None
    holes = array(read(prim.prim, "holeIndices", ctx.when), 1, "i")
    if holes is None or len(holes) == 0:
        return None
    inside = holes[(holes >= 0) & (holes < faces)]
    if len(inside) < len(holes):
        ctx.warn("invalid-primvar", prim.path, f"holeIndices has indices outside the {faces} faces.")
    return inside


def without_holes(keep: Flags | None, prim: ResolvedPrim, faces: int, ctx: Context) -> Flags | None:
    """`keep` without the faces that holeIndices names: polygons have no other use for them."""
    holes = hole_indices(prim, faces, ctx)
    if holes is None:
        return keep
    kept = np.ones(faces, bool) if keep is None else keep
    kept[holes] = False
    return kept
