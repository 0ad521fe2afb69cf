"""Trim curves of a NurbsPatch (its trimCurve attributes) as loops of curves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Ints
from ...description import TrimCurve
from ...description.nurbs import TrimLoop
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import array, read
from .directions import Unfit, direction_of, fits

PREFIX = "trimCurve:"
NAMES = ("counts", "orders", "vertexCounts", "knots", "ranges", "points")
APART = 1e-3  # of the parameter range: larger gaps between a loop's ends are reported


def read_trims(prim: ResolvedPrim, size: tuple[float, float], ctx: Context) -> tuple[TrimLoop, ...]:
    """Return the trim loops; empty, and reported, if the attributes do not fit each other. `size` is the extent of the patch's
    parameters."""
    if not any(PREFIX + name in prim.names for name in NAMES):
        return ()
    try:
        loops = _loops(prim, ctx)
    except Unfit as error:
        ctx.warn("nurbs-data", prim.path, f"Trim curves are ignored: {error}", error.attribute)
        return ()
    _note_open(loops, size, prim, ctx)
    return loops


def _loops(prim: ResolvedPrim, ctx: Context) -> tuple[TrimLoop, ...]:
    counts, orders, vertices = (_integers(prim, name, ctx) for name in ("counts", "orders", "vertexCounts"))
    knots, ranges, points = (_doubles(prim, name, n, ctx) for name, n in (("knots", 1), ("ranges", 2), ("points", 3)))
    curves = int(counts.sum())
    if (counts < 1).any():
        raise Unfit("a loop has no curves.", PREFIX + "counts")
    for name, values, needed in (
        ("orders", orders, curves),
        ("vertexCounts", vertices, curves),
        ("knots", knots, int(vertices.sum() + orders.sum())),
        ("points", points, int(vertices.sum())),
    ):
        if len(values) != needed:
            raise Unfit(f"{PREFIX}{name} has {len(values)} values where {needed} are needed.", PREFIX + name)
    if len(ranges) not in (0, curves):
        raise Unfit(f"{PREFIX}ranges has {len(ranges)} values where {curves} are needed.", PREFIX + "ranges")
    if not np.isfinite(points).all() or (points[:, 2] <= 0).any():
        raise Unfit(
            f"{PREFIX}points has points that are not finite, or whose weight (third component) is not positive.",
            PREFIX + "points",
        )
    found = [
        TrimCurve(
            direction_of(
                int(vertices[k]),
                int(orders[k]),
                knots[slice(*at_knots)],
                (float(ranges[k, 0]), float(ranges[k, 1])) if len(ranges) else None,
                (PREFIX + "orders", PREFIX + "knots"),
            ),
            points[slice(*at_points)],
        )
        for k, (at_knots, at_points) in enumerate(zip(_pieces(vertices + orders), _pieces(vertices), strict=True))
    ]
    if not all(fits(curve.basis) for curve in found):
        raise Unfit(f"{PREFIX}ranges has a range that is empty.", PREFIX + "ranges")
    return tuple(tuple(found[slice(*loop)]) for loop in _pieces(counts))


def _pieces(counts: Ints) -> list[tuple[int, int]]:
    return list(pairwise([0, *np.cumsum(counts).tolist()]))


def _integers(prim: ResolvedPrim, name: str, ctx: Context) -> npt.NDArray[np.int32]:
    return np.asarray(_array(prim, name, 1, "i", ctx), np.int32)


def _doubles(prim: ResolvedPrim, name: str, width: int, ctx: Context) -> Doubles:
    return np.asarray(_array(prim, name, width, "f", ctx), np.float64)


def _array(prim: ResolvedPrim, name: str, width: int, kind: str, ctx: Context) -> npt.NDArray[np.generic]:
    raw = read(prim.prim, PREFIX + name, ctx.when)
    values = array([] if raw is None else raw, width, kind)
    if values is None:
        raise Unfit(f"{PREFIX}{name} is of the wrong type.", PREFIX + name)
    return values


def _note_open(loops: tuple[TrimLoop, ...], size: tuple[float, float], prim: ResolvedPrim, ctx: Context) -> None:
    """Report loops whose ends do not meet; they are joined by straight lines."""
    is_open = [loop for loop in loops if any(_apart(a, b, size) for a, b in zip(loop, (*loop[1:], loop[0]), strict=True))]
    if is_open:
        message = f"{len(is_open)} of {len(loops)} trim loops are not closed: their ends are joined by straight lines."
        ctx.warn("nurbs-data", prim.path, message, PREFIX + "points")


def _apart(a: TrimCurve, b: TrimCurve, size: tuple[float, float]) -> bool:
    from ...refine.nurbs.trim_curves import end_of, start_of

    return bool((np.abs(end_of(a) - start_of(b)) > APART * np.array(size)).any())
