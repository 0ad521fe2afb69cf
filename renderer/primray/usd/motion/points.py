"""Motion of points over the shutter, by samples or by velocities and accelerations (UsdGeomPointBased, UsdGeomPointInstancer),
and the times at which to sample it.

Velocities apply if they have samples at the same times as the points, on both sides of the frame; everything is then computed
from the sample at or before the frame, ignoring other samples. Otherwise they are ignored. Sample times are authored ones and,
along curved paths, as many in between as an error bound in pixels requires.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.metadata import time_codes_per_second
from ..stage.time_varying import has_time_values
from .attributes import ArrayPath, Rows, bend_times, is_animated
from .sample_times import sample_times

ACCELERATIONS = "accelerations"


@dataclass(frozen=True, eq=False)
class PointPath:
    """Positions of points (N, 3), or other values per point, at offsets from the frame."""

    at: Callable[[float], Rows]
    times: tuple[float, ...]  # offsets at which paths may bend
    acceleration: float = 0.0  # largest, in units per time code squared; curved paths have one


@dataclass(frozen=True, eq=False)
class Rates:
    """Velocities and accelerations from the sample at or before the frame."""

    since: float  # time codes from that sample to the frame
    per_second: float  # time codes per second
    start: Rows  # (N, 3)
    velocities: Doubles  # (N, 3), units per second
    accelerations: Doubles | None

    def seconds(self, offset: float) -> float:
        return (self.since + offset) / self.per_second


def point_path(prim: ResolvedPrim, name: str, ctx: Context) -> PointPath | None:
    """Return the motion of the attribute `name`; None if it keeps its value at the frame."""
    if not may_have_motion(prim, ctx):
        return None
    attribute = prim.prim.GetAttribute(name)
    path = ArrayPath(attribute, 3, ctx.when)
    rates = rates_of(prim, path, ctx)
    if rates is not None:
        return _path_by_rates(rates)
    if ctx.timing.is_frame or not is_animated(attribute, ctx.when, ctx.timing):
        return None
    return sampled_point_path(prim, path, ctx)


def may_have_motion(prim: ResolvedPrim, ctx: Context) -> bool:
    """Return whether the prim may have motion, a cheap test to make first; prims with velocities are moved by them at the
    frame, too."""
    if ctx.timing.is_frame:
        return not (ctx.when.is_default or VELOCITIES.isdisjoint(prim.names))
    return ctx.timing.is_timed


def sampled_point_path(prim: ResolvedPrim, path: ArrayPath, ctx: Context) -> PointPath | None:
    """Return the motion by samples; None, and reported, if the number of values changes over the shutter."""
    here = path.at(0.0)
    times = bend_times([path.attribute], ctx.when, ctx.timing)
    if here is None:
        return None
    counts = {None if rows is None else len(rows) for rows in map(path.at, (*ctx.timing.looked_at, *times))}
    name = str(path.attribute.GetName())
    if counts != {len(here)}:
        message = f"{name} are not blurred: their number changes while the shutter is open."
        ctx.warn("motion", prim.path, message, name)
        return None

    def at(offset: float) -> Rows:
        found = path.at(offset)
        return here if found is None or len(found) != len(here) else found

    return PointPath(at, tuple(times))


VELOCITIES = frozenset(["velocities", "primvars:velocities", "angularVelocities"])


def rates_of(prim: ResolvedPrim, points: ArrayPath, ctx: Context) -> Rates | None:
    """Return the velocities; None if they do not apply, which is reported."""
    name = next((n for n in ("velocities", "primvars:velocities") if n in prim.names), "")
    around = points.bracket()
    if not name:
        return None
    velocities = ArrayPath(prim.prim.GetAttribute(name), 3, ctx.when)
    problem = sample_mismatch(velocities, points, around)
    start = None if around is None else points.sample(around[0])
    if problem or around is None or start is None or points.frame is None:
        report_unused(problem, name, prim, ctx)
        return None
    accelerations: Doubles | None = None
    if ACCELERATIONS in prim.names:
        further = ArrayPath(prim.prim.GetAttribute(ACCELERATIONS), 3, ctx.when)
        problem = sample_mismatch(further, points, around)
        accelerations = None if problem else _doubles(further.sample(around[0]))
        report_unused(problem, ACCELERATIONS, prim, ctx)
    per_second = time_codes_per_second(ctx.stage)
    speeds = _doubles(velocities.sample(around[0]))
    return Rates(points.frame - around[0], per_second, start, speeds, accelerations)


def _doubles(rows: Rows | None) -> npt.NDArray[np.float64]:
    return np.zeros((0, 3)) if rows is None else rows.astype(np.float64)


def sample_mismatch(found: ArrayPath, points: ArrayPath, around: tuple[float, float] | None) -> str:
    """Return why an attribute cannot be used with the points, or "" if it can."""
    if not has_time_values(found.attribute):
        return "they have no time samples"
    if around is None:
        return "the points have no time samples"
    if found.bracket() != around:
        return "their samples are at other times than those of the points"
    rows, start = found.sample(around[0]), points.sample(around[0])
    if rows is None or start is None or len(rows) != len(start):
        return "their number differs from that of the points"
    return ""


def report_unused(problem: str, name: str, prim: ResolvedPrim, ctx: Context) -> None:
    if problem and not ctx.timing.is_frame:
        ctx.warn("motion", prim.path, f"{name} are ignored: {problem}.", name)


def _path_by_rates(rates: Rates) -> PointPath:
    start = rates.start.astype(np.float64)

    def at(offset: float) -> Rows:
        return extrapolated_positions(rates, start, offset)

    return PointPath(at, (), acceleration_of(rates))


def extrapolated_positions(rates: Rates, start: Rows, offset: float) -> Doubles:
    """Return p + t (v + t a / 2) (UsdGeom's overview, "Applying Timesampled Velocities to Geometry")."""
    t = rates.seconds(offset)
    speeds = rates.velocities if rates.accelerations is None else rates.velocities + 0.5 * t * rates.accelerations
    return np.asarray(start + t * speeds)


def acceleration_of(rates: Rates) -> float:
    if rates.accelerations is None or not len(rates.accelerations):
        return 0.0
    return float(np.linalg.norm(rates.accelerations, axis=1).max()) / rates.per_second**2


SIZE_NO_ERROR = 1e-6  # of the swept extent: samples off the line by less are left out,
PIXELS_NO_ERROR = 1e-3  # but only up to this many pixels


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
    steps = sample_times(error, bent, most, none)
    ctx.findings.point_steps.append(steps.of(path, "meshes", rounding))
    return steps.times
