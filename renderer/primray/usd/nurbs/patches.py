"""Authored data of a NurbsPatch prim: its two directions, control points, weights and trim curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles, Floats
from ...description import Direction
from ...description.nurbs import TrimLoop
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..shapes.topology import LARGEST
from ..stage.values import array, read, token
from .directions import Unfit, direction_of, fits, whole
from .trims import read_trims


@dataclass(frozen=True, eq=False)
class AuthoredPatch:
    points: Floats  # (N, 3), u varying fastest
    weights: Doubles | None  # (N,)
    u: Direction
    v: Direction
    loops: tuple[TrimLoop, ...]
    is_left_handed: bool


def read_patch(prim: ResolvedPrim, ctx: Context) -> AuthoredPatch | None:
    """Return the patch; None, and reported, if its attributes make no surface."""
    try:
        return _patch(prim, ctx)
    except Unfit as error:
        ctx.warn("invalid-nurbs", prim.path, str(error), error.attribute)
        return None


def _patch(prim: ResolvedPrim, ctx: Context) -> AuthoredPatch:
    u, v = _direction(prim, "u", ctx), _direction(prim, "v", ctx)
    points = array(read(prim.prim, "points", ctx.when), 3, "f")
    count = u.count * v.count
    if points is None or len(points) != count:
        has = "none" if points is None else str(len(points))
        raise Unfit(f"uVertexCount and vVertexCount need {count} points, but there are {has}.", "points")
    if not (np.abs(points) <= LARGEST).all():
        raise Unfit("points has values that are not finite or beyond 1e37.", "points")
    is_left = "orientation" in prim.names and token(prim.prim, "orientation", ctx.when, "") == "leftHanded"
    size = (u.high - u.low, v.high - v.low)
    points = np.ascontiguousarray(points, np.float32)
    return AuthoredPatch(points, _weights(prim, count, ctx), u, v, read_trims(prim, size, ctx), is_left)


def _direction(prim: ResolvedPrim, side: str, ctx: Context) -> Direction:
    count, order = (_integer(prim, side + name, ctx) for name in ("VertexCount", "Order"))
    name = f"{side}Knots"
    knots = array(read(prim.prim, name, ctx.when), 1, "f")
    if knots is None:
        raise Unfit(f"{name}: missing, or of the wrong type.", name)
    found = direction_of(count, order, knots.astype(np.float64), None, (f"{side}Order", name))
    drawn = _range(prim, f"{side}Range", ctx)
    if drawn is None:
        return found
    cut = direction_of(count, order, knots.astype(np.float64), drawn, (f"{side}Order", name))
    low, high = whole(found)
    if not fits(cut):
        message = f"{side}Range does not overlap [{low:g}, {high:g}], all of which is drawn."
        ctx.warn("nurbs-data", prim.path, message, f"{side}Range")
        return found
    return cut


def _range(prim: ResolvedPrim, name: str, ctx: Context) -> tuple[float, float] | None:
    if name not in prim.names:
        return None
    raw = read(prim.prim, name, ctx.when)
    if raw is None:
        return None
    low, high = (float(x) for x in raw)
    return (low, high) if np.isfinite([low, high]).all() else None


def _integer(prim: ResolvedPrim, name: str, ctx: Context) -> int:
    raw = read(prim.prim, name, ctx.when)
    if not isinstance(raw, int):
        raise Unfit(f"{name}: missing, or of the wrong type.", name)
    return raw


def _weights(prim: ResolvedPrim, count: int, ctx: Context) -> Doubles | None:
    if "pointWeights" not in prim.names:
        return None
    raw = read(prim.prim, "pointWeights", ctx.when)
    weights = None if raw is None else array(raw, 1, "f")
    if raw is None or (weights is not None and len(weights) == 0):
        return None
    if weights is None or len(weights) != count or not np.isfinite(weights).all() or not (weights > 0).all():
        message = f"pointWeights are ignored: {count} positive numbers are needed."
        ctx.warn("nurbs-data", prim.path, message, "pointWeights")
        return None
    return weights.astype(np.float64)
