"""Authored vertices of a curves prim: their number per curve, their positions, and which curves can be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Floats
from ..paths.points import PointPath, point_path
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..shapes.topology import LARGEST
from ..stage.values import array, read
from .curve_set import Ints


@dataclass(frozen=True, eq=False)
class AuthoredCurves:
    counts: Ints  # (C,) not negative
    points: Floats  # (V, 3), at the frame, or at the instant of a still
    path: PointPath | None  # motion of the points
    good: npt.NDArray[np.bool_]  # (C,) all of its vertices exist and are finite


def read_curves(prim: ResolvedPrim, ctx: Context) -> AuthoredCurves | None:
    """Return the curves, or None if there are none; reports attributes that are missing or unusable."""
    counts = array(read(prim.prim, "curveVertexCounts", ctx.when), 1, "i")
    points = array(read(prim.prim, "points", ctx.when), 3, "f")
    if counts is None or points is None or len(counts) == 0 or len(points) == 0:
        if counts is None or points is None or len(counts) != len(points):
            name = "points" if points is None or (counts is not None and len(points) == 0) else "curveVertexCounts"
            ctx.warn("invalid-curves", prim.path, f"{name}: missing, or of the wrong type.", name)
        return None
    path = point_path(prim, "points", ctx)
    if path is not None:
        points = path.at(0.0 if ctx.timing.is_open else prim.inherited.blur_scale * ctx.timing.opens)
    counts = np.maximum(counts, 0).astype(np.int64)
    if (total := int(counts.sum())) != len(points):
        ctx.warn("invalid-curves", prim.path, f"curveVertexCounts need {total} points, but there are {len(points)}.")
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(points).max(axis=1) <= LARGEST)
    return AuthoredCurves(counts, points.astype(np.float32, copy=False), path, without(bad, counts))


def without(bad: npt.NDArray[np.bool_], counts: Ints) -> npt.NDArray[np.bool_]:
    """Return the mask (C,) of curves that have none of the `bad` vertices (V,)."""
    if not bad.any():
        return np.ones(len(counts), bool)
    before = np.concatenate([[0], np.cumsum(bad)])
    ends = np.minimum(np.cumsum(counts), len(bad))
    return np.asarray(before[ends] == before[np.minimum(ends - counts, len(bad)).clip(0)])


def note_left_out(count: int, drawn: int, why: str, prim: ResolvedPrim, ctx: Context) -> None:
    if drawn < count:
        message = f"{count - drawn} of {count} curves are left out: {why}."
        ctx.warn("invalid-curves", prim.path, message, "curveVertexCounts")
