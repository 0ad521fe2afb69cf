"""Implicit shapes with animated sizes, tessellated at each sampled time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..moving.steps import fractions
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..shapes.seam_mesh import PolygonMotion, Values
from ..shapes.tessellate import Tessellated, cap_rings, capsule
from ..stage.values import When
from .changes import bends, moves
from .point_steps import point_steps

Call = tuple[Any, ...]  # a function of tessellate.py and its arguments: many shapes are alike
SIZES = ("size", "width", "length", "radius", "height", "radiusBottom", "radiusTop")
FLAT = 1e-12  # replaces 0, so that flat shapes have the same triangles at all times


@dataclass(frozen=True, eq=False)
class SizePath:
    """Motion of an implicit shape. Offsets from the frame include motion:blurScale."""

    prim: ResolvedPrim
    at: Callable[[float], Call]
    times: tuple[float, ...]
    here: float  # offset of the frame, or of the instant of a still
    blur_scale: float

    def motion(self, frame: Tessellated, ctx: Context) -> PolygonMotion | None:
        """Return the motion of the tessellation `frame`; None if it does not change while the shutter is open."""
        if not ctx.timing.is_open:
            return None
        known: dict[float, Tessellated] = {}

        def at(fraction: float) -> Tessellated:
            if fraction not in known:
                how = self.at(self.blur_scale * ctx.timing.offset(fraction))
                known[fraction] = how[0](*how[1:])
            return known[fraction]

        bent = fractions(self.times, ctx.timing.span, self.blur_scale)
        looked_at = [at(time) for time in (0.0, *(time for time in bent if 0.0 < time < 1.0), 0.5, 1.0)]
        if not all(_is_alike(frame, then) for then in looked_at):
            ctx.warn("motion", self.prim.path, "Its size is not blurred: the topology changes, as when a size passes 0.")
            return None
        count = len(frame.points)
        times = point_steps(lambda fraction: _rows(at(fraction)), count, bent, self.prim.path, ctx, curved=True)
        if times is None:
            return None
        found = [at(time) for time in times]
        normals = [made.normals for made in found if made.normals is not None]
        turning = bool(normals) and not all(np.array_equal(normals[0], then) for then in normals)
        points = np.stack([made.points for made in found])
        return PolygonMotion(np.array(times), points, tuple(Values(then, "corner") for then in normals) if turning else ())


def growing_shape(prim: ResolvedPrim, how: Callable[[When], Call], ctx: Context) -> SizePath | None:
    """Return the shape's motion, or None if its sizes do not change; the axis is that of the frame. `how` returns the
    tessellation at a time."""
    if ctx.timing.is_frame:
        return None
    sizes = [attribute for name in SIZES if (attribute := prim.prim.GetAttribute(name))]
    moving = [attribute for attribute in sizes if moves(attribute, ctx.when, ctx.timing)]
    if not moving:
        return None
    frame = how(ctx.when)
    rings = cap_rings(*frame[1:4]) if frame[0] is capsule and ctx.timing.is_open else ()

    def at(offset: float) -> Call:
        then = how(ctx.when.after(offset))
        return (*(_thick(was if isinstance(was, str) else now) for was, now in zip(frame, then, strict=True)), *rings)

    scale = prim.inherited.blur_scale
    here = 0.0 if ctx.timing.is_open else scale * ctx.timing.opens
    return SizePath(prim, at, tuple(bends(moving, ctx.when, ctx.timing)), here, scale)


def _thick(given: Any) -> Any:
    return FLAT if isinstance(given, float) and given == 0.0 else given


def _is_alike(a: Tessellated, b: Tessellated) -> bool:
    return len(a.points) == len(b.points) and np.array_equal(a.triangles, b.triangles) and bool(np.isfinite(b.points).all())


def _rows(made: Tessellated) -> np.ndarray[Any, np.dtype[np.float32]]:
    return made.points if made.normals is None else np.concatenate([made.points, made.normals])
