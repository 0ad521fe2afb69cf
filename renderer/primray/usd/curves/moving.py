"""Motion of curve control points over the shutter: point samples or velocities, and widths that change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Floats
from ...description import PointMotion
from ..moving.steps import fractions
from ..paths.changes import bends, moves
from ..paths.meshes import finite_points
from ..paths.point_steps import point_steps
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from .authored import AuthoredCurves
from .curve_set import CurveSet
from .values import fitting, name_of_widths, radii_of, read_widths


def with_normals(motion: PointMotion, normals: Floats) -> PointMotion:
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
    widens = bool(attribute) and ctx.timing.is_timed and moves(attribute, ctx.when, ctx.timing)
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
            fits = None if widths is None else fitting(widths, curves)
            found = None if fits is None else radii_of(fits, curves)
            then[:, 3] = then[:, 3] if found is None else found
        return then

    bent = {*(authored.path.times if authored.path else ()), *(bends([attribute], ctx.when, ctx.timing) if widens else ())}
    curved = authored.path is not None and authored.path.acceleration > 0
    times = point_steps(
        at, len(controls), fractions(tuple(sorted(bent)), ctx.timing.span, scale), prim.path, ctx, curved=curved
    )
    return None if times is None else PointMotion(np.array(times), np.stack([at(time) for time in times]))
