"""Authored vertices of a curves prim: their number per curve, their positions, which curves can be drawn, and their motion over
the shutter (point samples or velocities, and widths that change)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Floats
from ...description import PointMotion
from ..mesh.authored import LARGEST
from ..mesh.motion import finite_points
from ..motion.attributes import bend_times, is_animated
from ..motion.points import PointPath, point_path, point_steps
from ..motion.sample_times import fractions
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import array, read
from .curve_set import CurveSet, Ints
from .values import name_of_widths, radii_of, read_widths, with_fitting_interpolation


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
