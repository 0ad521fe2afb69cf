"""Adapters for UsdGeomBasisCurves, HermiteCurves and NurbsCurves: tubes, or ribbons where normals are authored. Points and
widths become Bezier control points, with primvars along the curve.

Each segment has the appearance of the subset that contains it, or that of the curves. Points and widths may move over the
shutter, by samples or velocities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ...arrays import Floats
from ...description import Curves, PointMotion, PrimvarInput, Ribbons, Shape, Surface
from ..materials.appearance import FALLBACK_COLOR, Appearance, appearance_of, is_cut_out, make_surface, undisplaced
from ..mesh.motion import finite_points
from ..mesh.triangulate import LARGEST
from ..motion.attributes import bend_times, is_animated
from ..motion.points import PointPath, point_path, point_steps
from ..motion.sample_times import fractions
from ..scene.bindings import Subset
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import array, read, token
from .bezier import BEZIER, BSPLINE, CATMULL_ROM, CurveSet, Ints, basis_curves, hermite_controls, hermite_curves
from .nurbs import nurbs_curves
from .values import (
    DISPLAY_COLOR,
    control_normals,
    curve_primvars,
    name_of_widths,
    radii,
    radii_of,
    read_widths,
    with_fitting_interpolation,
)


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
    return AuthoredCurves(counts, points.astype(np.float32, copy=False), path, curves_without(bad, counts))


def curves_without(bad: npt.NDArray[np.bool_], counts: Ints) -> npt.NDArray[np.bool_]:
    """Return the mask (C,) of curves that have none of the `bad` vertices (V,)."""
    if not bad.any():
        return np.ones(len(counts), bool)
    before = np.concatenate([[0], np.cumsum(bad)])
    ends = np.minimum(np.cumsum(counts), len(bad))
    return np.asarray(before[ends] == before[np.minimum(ends - counts, len(bad)).clip(0)])


def report_left_out(count: int, drawn: int, why: str, prim: ResolvedPrim, ctx: Context) -> None:
    if drawn < count:
        message = f"{count - drawn} of {count} curves are left out: {why}."
        ctx.warn("invalid-curves", prim.path, message, "curveVertexCounts")


def ribbon_motion(motion: PointMotion, normals: Floats) -> PointMotion:
    """Return the motion of ribbons, whose normals keep their value at the frame."""
    steps = np.broadcast_to(normals, (len(motion.times), *normals.shape))
    return PointMotion(motion.times, np.concatenate([motion.points, steps], axis=2))


def moving_controls(
    prim: ResolvedPrim,
    authored: AuthoredCurves,
    curves: CurveSet,
    places: Callable[[Floats], Floats],
    controls: Floats,
    ctx: Context,
) -> PointMotion | None:
    """Return the motion of the control points, or None if they do not move or only a still is made. `places` maps vertices to
    control points; `controls` (3 S + C, 4) are those at the frame."""
    if not ctx.timing.is_open:
        return None
    attribute = prim.prim.GetAttribute(name_of_widths(prim))
    widens = bool(attribute) and ctx.timing.is_timed and is_animated(attribute, ctx.when, ctx.timing)
    if authored.path is None and not widens:
        return None
    scale = prim.inherited.blur_scale

    def at(fraction: float) -> Floats:
        offset = scale * ctx.timing.offset(fraction)
        then = controls.copy()
        if authored.path is not None:
            points = finite_points(authored.path.at(offset).astype(np.float32), authored.points)
            then[:, :3] = places(points)
        if widens:
            widths = read_widths(prim, ctx.when.after(offset))
            fits = None if widths is None else with_fitting_interpolation(widths, curves)
            found = None if fits is None else radii_of(fits, curves)
            then[:, 3] = then[:, 3] if found is None else found
        return then

    bent = {*(authored.path.times if authored.path else ()), *(bend_times([attribute], ctx.when, ctx.timing) if widens else ())}
    curved = authored.path is not None and authored.path.acceleration > 0
    times = point_steps(
        at, len(controls), fractions(tuple(sorted(bent)), ctx.timing.span, scale), prim.path, ctx, curved=curved
    )
    return None if times is None else PointMotion(np.array(times), np.stack([at(time) for time in times]))


@dataclass(frozen=True, eq=False)
class CurveGeometry:
    """Geometry of a curves prim, independent of its materials."""

    authored: AuthoredCurves
    curves: CurveSet
    places: Callable[[Floats], Floats]  # maps vertices (V, 3) to control points (3 S + C, 3)
    radii: Floats  # (3 S + C,) at the frame's time
    normals: Floats | None = None  # (3 S + C, 3), ribbons only


def basis_curves_of(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    authored = read_curves(prim, ctx)
    if authored is None:
        return None
    kind, basis, wrap = (_allowed_token(prim, name, default, allowed, ctx) for name, default, allowed in _TOKENS)
    curves = basis_curves(authored.counts, len(authored.points), authored.good, kind, basis, wrap)
    why = f"their number of vertices does not fit {wrap} {kind} curves of basis {basis}, or vertices are not finite"
    return _make_from_set(prim, authored, curves, curves.controls, why, ctx)


def hermite_curves_of(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    authored = read_curves(prim, ctx)
    if authored is None:
        return None
    tangents = array(read(prim.prim, "tangents", ctx.when), 3, "f")
    if tangents is None or len(tangents) != len(authored.points):
        found = "no" if tangents is None else len(tangents)
        message = f"It has {found} tangents for {len(authored.points)} points: its curves are not rendered."
        ctx.warn("invalid-curves", prim.path, message, "tangents")
        return None
    good = authored.good & curves_without(~np.isfinite(tangents).all(axis=1), authored.counts)
    curves = hermite_curves(authored.counts, len(authored.points), good)
    known: Floats = tangents.astype(np.float32, copy=False)
    why = "they have too few vertices, or vertices are not finite"
    return _make_from_set(prim, authored, curves, lambda points: hermite_controls(curves, points, known), why, ctx)


def nurbs_curves_of(prim: ResolvedPrim, ctx: Context) -> Shape | None:
    authored = read_curves(prim, ctx)
    if authored is None:
        return None
    orders = array(read(prim.prim, "order", ctx.when), 1, "i")
    knots = array(read(prim.prim, "knots", ctx.when), 1, "f")
    ranges = array(read(prim.prim, "ranges", ctx.when), 2, "f")
    weights = array(read(prim.prim, "pointWeights", ctx.when), 1, "f")
    if orders is None or knots is None:
        name = "order" if orders is None else "knots"
        ctx.warn("invalid-curves", prim.path, f"{name}: missing, or of the wrong type.", name)
        return None
    if weights is not None and len(weights) != len(authored.points):
        message = f"It has {len(weights)} pointWeights for {len(authored.points)} points: weights of 1 are used."
        if len(weights):
            ctx.warn("invalid-primvar", prim.path, message, "pointWeights")
        weights = None
    if ranges is not None and len(ranges) == 0:
        ranges = None
    curves = nurbs_curves(authored.counts, authored.points, authored.good, orders, knots, ranges, weights)
    why = "their order, knots, range or weights are invalid, or their points are not finite"
    return _make_from_set(prim, authored, curves, curves.controls, why, ctx)


def _make_from_set(
    prim: ResolvedPrim,
    authored: AuthoredCurves,
    curves: CurveSet,
    places: Callable[[Floats], Floats],
    why: str,
    ctx: Context,
) -> Shape | None:
    report_left_out(len(authored.counts), len(curves.drawn), why, prim, ctx)
    if not len(curves.drawn):
        return None
    normals = control_normals(prim, curves, ctx)
    own = radii(prim, curves, authored.points, ctx)
    return make_curves(prim, CurveGeometry(authored, curves, places, own, normals), ctx)


_TOKENS = (
    ("type", "cubic", ("cubic", "linear")),
    ("basis", BEZIER, (BEZIER, BSPLINE, CATMULL_ROM)),
    ("wrap", "nonperiodic", ("nonperiodic", "periodic", "pinned")),
)


def _allowed_token(prim: ResolvedPrim, name: str, default: str, allowed: tuple[str, ...], ctx: Context) -> str:
    found = token(prim.prim, name, ctx.when, default)
    if found in allowed:
        return found
    ctx.warn("invalid-curves", prim.path, f"{name} = {found!r} is not one of {', '.join(allowed)}: {default} is used.", name)
    return default


def make_curves(prim: ResolvedPrim, geometry: CurveGeometry, ctx: Context) -> Curves | Ribbons | None:
    curves, is_tube = geometry.curves, geometry.normals is None
    parts, of_segment = segment_parts(prim, curves, ctx)
    worn = [k for k in np.unique(of_segment).tolist() if not is_cut_out(parts[k])]
    if not worn:
        return None
    surfaces = {
        k: undisplaced(make_surface(_with_display_color(parts[k]), lambda: is_tube, prim.path, ctx), prim.path, ctx)
        for k in worn
    }
    if is_tube and any(map(emits_light, surfaces.values())):
        ctx.warn("curve-lights", prim.path, "Its curves emit light, but curves are not sampled as lights: expect noise.")
    controls = np.column_stack([geometry.places(geometry.authored.points), geometry.radii])
    segments = curves.segments.astype(np.int32)
    numbers = {k: ctx.surfaces.index_of(surface) for k, surface in surfaces.items()}
    number = numbers[0] if len(parts) == 1 else np.array([numbers.get(k, -1) for k in range(len(parts))], np.int32)[of_segment]
    primvars = curve_primvars(prim, tuple(surfaces.values()), curves, ctx)
    motion = moving_controls(prim, geometry.authored, curves, geometry.places, controls, ctx)
    if not geometry.radii.any() and (motion is None or not motion.points[..., 3].any()):
        return None
    if geometry.normals is None:
        return Curves(
            path=prim.path,
            controls=controls,
            segments=segments,
            surface=number,
            closed=curves.closed,
            joined=curves.joined,
            primvars=primvars,
            motion=motion,
        )
    motion = None if motion is None else ribbon_motion(motion, geometry.normals)
    return Ribbons(
        path=prim.path,
        controls=controls,
        normals=geometry.normals,
        segments=segments,
        surface=number,
        primvars=primvars,
        motion=motion,
    )


def _with_display_color(appearance: Appearance) -> Appearance:
    """Return the appearance with displayColor read as an ordinary primvar, if it varies over the curves."""
    if not appearance.varying_color:
        return appearance
    inputs = (*appearance.inputs, ("diffuse_color", PrimvarInput(DISPLAY_COLOR, FALLBACK_COLOR)))
    return replace(appearance, color=FALLBACK_COLOR, varying_color=False, inputs=inputs)


def emits_light(surface: Surface) -> bool:
    return any(surface.emissive_color) or any(name == "emissive_color" for name, _ in surface.inputs)


def segment_parts(prim: ResolvedPrim, curves: CurveSet, ctx: Context) -> tuple[list[Appearance], Ints]:
    """Return the appearances, with the curves' own first, and for each of the S drawn segments the index of its appearance."""
    parts = [appearance_of(prim, prim.material, ctx)]
    of_segment = np.zeros(int(curves.segments.sum()), np.int64)
    families: list[str | None] = [None]
    for subset in prim.subsets:
        held = _segments_of(subset, curves, ctx)
        if held is None:
            continue
        twice = np.array([family == subset.family for family in families])[of_segment[held]]
        if twice.any():
            message = f"{int(twice.sum())} of its segments are also in another subset of its family: this one is used."
            ctx.warn("subset-overlap", subset.path, message, "indices")
        families.append(subset.family)
        of_segment[held] = len(parts)
        parts.append(appearance_of(prim, subset.material, ctx))
    return parts, of_segment


def _segments_of(subset: Subset, curves: CurveSet, ctx: Context) -> Ints | None:
    """Return the drawn segments in a subset, whose indices are pairs of curve and segment within it; None and reported if they
    are out of range."""
    indices = array(read(subset.prim, "indices", ctx.when), 1, "i")
    pairs = None if indices is None or len(indices) % 2 else indices.reshape(-1, 2).astype(np.int64)
    place = np.full(curves.sizes.faces, -1)
    place[curves.drawn] = np.arange(len(curves.drawn))
    if pairs is not None and ((pairs >= 0).all() and (pairs[:, 0] < len(place)).all()):
        at = place[pairs[:, 0]]
        drawn = at >= 0
        if (pairs[drawn, 1] < curves.segments[at[drawn]]).all():
            return np.asarray(curves.first_segments[at[drawn]] + pairs[drawn, 1])
    message = f"Its indices are not pairs of a curve ({len(place)} in all) and a segment of it: the subset is ignored."
    ctx.warn("subset-ignored", subset.path, message, "indices")
    return None
