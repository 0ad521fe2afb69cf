"""Adapter from UsdGeomNurbsPatch to a NurbsPatch, which is diced for the camera's view (tessellation/nurbs).

A prim has the two directions of its basis (order, knots and range), control points, weights, and trim curves as loops. What
does not fit is reported, and left out where the rest makes a surface. Authored normals are ignored.

Primvars are laid out as in RenderMan's NuPatch, which the schema follows: uniform ones have a value per knot segment, varying
and faceVarying ones per crossing of knots, vertex ones per control point. Unless authored, the texture coordinates `st` are the
parameters, from 0 to 1 over the drawn range.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats, Ints
from ...description import Direction, Interpolation, NurbsPatch, Surface, TrimCurve
from ...description import Primvar as SeamPrimvar
from ...description.geometry import TrimLoop
from ...tessellation.nurbs.patches import coarse_mesh
from ..materials.appearance import FALLBACK_COLOR, appearance_of, is_cut_out, make_surface, undisplaced
from ..mesh.authored import is_closed, report_inside_out
from ..mesh.motion import moving_points, path_of_points
from ..mesh.triangulate import LARGEST
from ..primvars.reading import Primvar, Sizes, read_display_color
from ..primvars.surface_primvars import TANGENT_ST, read_primvars
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import array, read, token


@dataclass(frozen=True, eq=False, kw_only=True)
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
    except InvalidBasis as error:
        ctx.warn("invalid-nurbs", prim.path, str(error), error.attribute)
        return None


def _patch(prim: ResolvedPrim, ctx: Context) -> AuthoredPatch:
    u, v = _direction(prim, "u", ctx), _direction(prim, "v", ctx)
    points = array(read(prim.prim, "points", ctx.when), 3, "f")
    count = u.count * v.count
    if points is None or len(points) != count:
        has = "none" if points is None else str(len(points))
        raise InvalidBasis(f"uVertexCount and vVertexCount need {count} points, but there are {has}.", "points")
    if not (np.abs(points) <= LARGEST).all():
        raise InvalidBasis("points has values that are not finite or beyond 1e37.", "points")
    is_left = "orientation" in prim.names and token(prim.prim, "orientation", ctx.when, "") == "leftHanded"
    size = (u.high - u.low, v.high - v.low)
    points = np.ascontiguousarray(points, np.float32)
    return AuthoredPatch(
        points=points, weights=_weights(prim, count, ctx), u=u, v=v, loops=read_trims(prim, size, ctx), is_left_handed=is_left
    )


def _direction(prim: ResolvedPrim, side: str, ctx: Context) -> Direction:
    count, order = (_integer(prim, side + name, ctx) for name in ("VertexCount", "Order"))
    name = f"{side}Knots"
    knots = array(read(prim.prim, name, ctx.when), 1, "f")
    if knots is None:
        raise InvalidBasis(f"{name}: missing, or of the wrong type.", name)
    found = direction_of(count, order, knots.astype(np.float64), None, (f"{side}Order", name))
    drawn = _range(prim, f"{side}Range", ctx)
    if drawn is None:
        return found
    cut = direction_of(count, order, knots.astype(np.float64), drawn, (f"{side}Order", name))
    low, high = domain(found)
    if not has_range(cut):
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
        raise InvalidBasis(f"{name}: missing, or of the wrong type.", name)
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


class InvalidBasis(Exception):
    """Authored values that do not make a basis. `attribute` is the one to correct."""

    def __init__(self, message: str, attribute: str) -> None:
        super().__init__(message)
        self.attribute = attribute


def direction_of(
    count: int, order: int, knots: Doubles, drawn: tuple[float, float] | None, names: tuple[str, str]
) -> Direction:
    """Return the basis with `drawn`, its range (None: all), limited to [knots[order - 1], knots[count]]. `names` are the
    attributes of order and knots. Raises Unfit where they do not make a basis."""
    if order < 2:
        raise InvalidBasis(f"{names[0]} is {order}, but must be at least 2.", names[0])
    if count < order:
        raise InvalidBasis(f"{names[0]} is {order}, more than the {count} control points.", names[0])
    if len(knots) != count + order:
        raise InvalidBasis(f"{names[1]} has {len(knots)} knots where {count + order} are needed.", names[1])
    if not np.isfinite(knots).all() or (np.diff(knots) < 0).any():
        raise InvalidBasis(f"{names[1]} has knots that decrease or are not finite.", names[1])
    first, last = float(knots[order - 1]), float(knots[count])
    if not first < last:
        raise InvalidBasis(f"{names[1]} are equal from knot {order - 1} to knot {count}: the range is empty.", names[1])
    low, high = drawn if drawn is not None else (first, last)
    return Direction(count, order, knots, max(low, first), min(high, last))


def has_range(direction: Direction) -> bool:
    """Return whether the drawn range is not empty."""
    return direction.low < direction.high


def domain(direction: Direction) -> tuple[float, float]:
    return float(direction.knots[direction.order - 1]), float(direction.knots[direction.count])


PREFIX = "trimCurve:"
NAMES = ("counts", "orders", "vertexCounts", "knots", "ranges", "points")
GAP = 1e-3  # of the parameter range: larger gaps between a loop's ends are reported


def read_trims(prim: ResolvedPrim, size: tuple[float, float], ctx: Context) -> tuple[TrimLoop, ...]:
    """Return the trim loops; empty, and reported, if the attributes do not fit each other. `size` is the extent of the patch's
    parameters."""
    if not any(PREFIX + name in prim.names for name in NAMES):
        return ()
    try:
        loops = _loops(prim, ctx)
    except InvalidBasis as error:
        ctx.warn("nurbs-data", prim.path, f"Trim curves are ignored: {error}", error.attribute)
        return ()
    _report_open_loops(loops, size, prim, ctx)
    return loops


def _loops(prim: ResolvedPrim, ctx: Context) -> tuple[TrimLoop, ...]:
    counts, orders, vertices = (_integers(prim, name, ctx) for name in ("counts", "orders", "vertexCounts"))
    knots, ranges, points = (_doubles(prim, name, n, ctx) for name, n in (("knots", 1), ("ranges", 2), ("points", 3)))
    curves = int(counts.sum())
    if (counts < 1).any():
        raise InvalidBasis("a loop has no curves.", PREFIX + "counts")
    for name, values, needed in (
        ("orders", orders, curves),
        ("vertexCounts", vertices, curves),
        ("knots", knots, int(vertices.sum() + orders.sum())),
        ("points", points, int(vertices.sum())),
    ):
        if len(values) != needed:
            raise InvalidBasis(f"{PREFIX}{name} has {len(values)} values where {needed} are needed.", PREFIX + name)
    if len(ranges) not in (0, curves):
        raise InvalidBasis(f"{PREFIX}ranges has {len(ranges)} values where {curves} are needed.", PREFIX + "ranges")
    if not np.isfinite(points).all() or (points[:, 2] <= 0).any():
        raise InvalidBasis(
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
    if not all(has_range(curve.basis) for curve in found):
        raise InvalidBasis(f"{PREFIX}ranges has a range that is empty.", PREFIX + "ranges")
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
        raise InvalidBasis(f"{PREFIX}{name} is of the wrong type.", PREFIX + name)
    return values


def _report_open_loops(loops: tuple[TrimLoop, ...], size: tuple[float, float], prim: ResolvedPrim, ctx: Context) -> None:
    """Report loops whose ends do not meet; they are joined by straight lines."""
    is_open = [loop for loop in loops if any(_are_apart(a, b, size) for a, b in zip(loop, (*loop[1:], loop[0]), strict=True))]
    if is_open:
        message = f"{len(is_open)} of {len(loops)} trim loops are not closed: their ends are joined by straight lines."
        ctx.warn("nurbs-data", prim.path, message, PREFIX + "points")


def _are_apart(a: TrimCurve, b: TrimCurve, size: tuple[float, float]) -> bool:
    from ...tessellation.nurbs.trimming import end_of, start_of

    return bool((np.abs(end_of(a) - start_of(b)) > GAP * np.array(size)).any())


INTERPOLATIONS = {
    "constant": Interpolation.CONSTANT,
    "uniform": Interpolation.FACE,
    "vertex": Interpolation.POINT,
    "varying": Interpolation.VARYING,
    "faceVarying": Interpolation.VARYING,
}


def nurbs_patch(prim: ResolvedPrim, ctx: Context) -> NurbsPatch | None:
    authored = read_patch(prim, ctx)
    appearance = appearance_of(prim, prim.material, ctx)
    if authored is None or is_cut_out(appearance):
        return None
    path = path_of_points(prim, ctx)
    points = authored.points
    if path is not None and path.points is not None:
        points = path.points.at(path.here).astype(np.float32)
    sizes = _sizes(authored)
    color = read_display_color(sizes, prim, ctx) if appearance.varying_color else None
    if color is not None and color.values.shape[1] != 3:
        color = None
    if appearance.varying_color and color is None:
        appearance = replace(appearance, color=FALLBACK_COLOR)
    made = NurbsPatch(
        path=prim.path,
        points=points,
        weights=authored.weights,
        u=authored.u,
        v=authored.v,
        surface=0,
        loops=authored.loops,
        colors=None if color is None else _described_primvar("displayColor", color),
        is_flipped=authored.is_left_handed,
        motion=None if path is None else moving_points(points, path, ctx),
    )
    surface = undisplaced(
        make_surface(appearance, lambda: _is_closed_patch(made, prim.path, ctx), prim.path, ctx), prim.path, ctx
    )
    return replace(made, surface=ctx.surfaces.index_of(surface), primvars=_primvars(prim, (surface,), authored, sizes, ctx))


def _sizes(patch: AuthoredPatch) -> Sizes:
    u, v = (d.count - d.order + 1 for d in (patch.u, patch.v))
    crossings = (u + 1) * (v + 1)
    return Sizes(u * v, patch.u.count * patch.v.count, crossings, ends=crossings)


def _is_closed_patch(patch: NurbsPatch, path: str, ctx: Context) -> bool:
    """Return whether the patch is closed, so that light can enter it. Reports patches whose normals point inwards."""
    mesh = coarse_mesh(patch)
    if patch.loops or not is_closed(mesh.points, mesh.triangles):
        return False
    report_inside_out(mesh.points, mesh.triangles, path, ctx)
    return True


def _primvars(
    prim: ResolvedPrim, surfaces: Collection[Surface], patch: AuthoredPatch, sizes: Sizes, ctx: Context
) -> tuple[SeamPrimvar, ...]:
    if not ctx.aov_primvars and not any(surface.inputs for surface in surfaces):
        return ()
    instead = {TANGENT_ST: _parameters(patch)}
    return tuple(_described_primvar(name, found) for name, found in read_primvars(prim, surfaces, sizes, ctx, instead))


def _parameters(patch: AuthoredPatch) -> Primvar:
    """Return the default `st` at the knots' crossings: 0 to 1 over the drawn range, beyond that outside the drawn range."""
    s, t = (_shares(direction) for direction in (patch.u, patch.v))
    st = np.stack(np.broadcast_arrays(s[None, :], t[:, None]), axis=2)
    return Primvar(st.reshape(-1, 2).astype(np.float32), "varying")


def _shares(d: Direction) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray((d.knots[d.order - 1 : d.count + 1] - d.low) / (d.high - d.low))


def _described_primvar(name: str, primvar: Primvar) -> SeamPrimvar:
    return SeamPrimvar(name, INTERPOLATIONS.get(primvar.interpolation, Interpolation.VARYING), primvar.flat())
