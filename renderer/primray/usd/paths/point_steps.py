"""Sample times of points that deform: their authored samples and, along curved paths, as many in between as an error bound in
pixels requires."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...arrays import Floats
from ...description import MotionSteps
from ..moving.steps import steps_of
from ..scene.context import Context

SIZE_NO_ERROR = 1e-6  # of the swept extent: samples off the line by less are left out,
PIXELS_NO_ERROR = 1e-3  # but only up to this many pixels


class PointSteps(list[MotionSteps]):
    """Samplings made during the translation, for the report."""


def point_steps(
    at: Callable[[float], Floats], count: int, bent: Sequence[float], path: str, ctx: Context, *, curved: bool
) -> tuple[float, ...] | None:
    """Return the fractions of the span at which to sample points; None if they do not move.

    `at` returns the moving rows: `count` points, whose first three columns are positions, and optionally normals. `bent` are
    the fractions at which paths may bend; `curved`: paths are not straight in between.
    """
    inside = [time for time in bent if 0.0 < time < 1.0]
    looked_at = [at(time) for time in (0.0, *inside, 0.5, 1.0)]
    if any(len(rows) != len(looked_at[0]) for rows in looked_at):
        return None
    if all(np.array_equal(rows, looked_at[0]) for rows in looked_at[1:]):
        return None
    points = np.concatenate([rows[:count] for rows in looked_at]).astype(np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = ctx.stands.per_length(low[:3], high[:3], ctx.foreseen) if ctx.stands is not None else 0.0
    scale = scale or ctx.foreseen.side / (float(np.linalg.norm(high - low)) or 1.0)
    scales = np.where(np.arange(len(looked_at[0])) < count, scale, 1.0)  # errors of normals are visible as pixels

    def error(a: float, b: float, time: float) -> float:
        u = (time - a) / (b - a)
        first, last = at(a).astype(np.float64), at(b).astype(np.float64)
        return float((np.linalg.norm(first + u * (last - first) - at(time), axis=1) * scales).max())

    rounding = 4 * float(np.finfo(np.float32).eps) * float(max(np.abs(low).max(), np.abs(high).max())) * scale
    none = max(min(SIZE_NO_ERROR * float((high - low).max()) * scale, PIXELS_NO_ERROR), rounding)
    most = max(ctx.settings.most_motion_error, rounding) if curved else float("inf")
    steps = steps_of(error, bent, most, none)
    ctx.kept.of(PointSteps).append(steps.of(path, "meshes", rounding))
    return steps.times
