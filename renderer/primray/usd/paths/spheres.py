"""Spheres with an animated radius: exact spheres, scaled by their transform."""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Doubles
from ..moving.mover import Local
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.values import read
from .changes import bends, moves


def growing_sphere(prim: ResolvedPrim, ctx: Context) -> tuple[Local, list[float]] | None:
    """Return the scale over time as a transform, 1 at the frame, and the offsets at which it may bend; None if the radius does
    not change."""
    if ctx.timing.is_frame:
        return None
    attribute, when = prim.prim.GetAttribute("radius"), ctx.when
    if not moves(attribute, when, ctx.timing):
        return None
    whole = _number(read(prim.prim, "radius", when))
    if not whole:
        return None

    def local(offset: float) -> Doubles:
        scale = abs(_number(read(prim.prim, "radius", when.after(offset))) / whole)
        return np.diag((scale, scale, scale, 1.0))

    return local, bends([attribute], when, ctx.timing)


def _number(found: object) -> float:
    return float(found) if isinstance(found, int | float) and math.isfinite(found) else 0.0
