"""Motion of points over the shutter, by samples or by velocities and accelerations (UsdGeomPointBased, UsdGeomPointInstancer).

Velocities apply if they have samples at the same times as the points, on both sides of the frame; everything is then computed
from the sample at or before the frame, ignoring other samples. Otherwise they are ignored.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.metadata import time_codes_per_second
from ..stage.time_varying import has_times
from .arrays import ArrayPath, Rows
from .changes import bends, moves

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
    if not may_move(prim, ctx):
        return None
    attribute = prim.prim.GetAttribute(name)
    path = ArrayPath(attribute, 3, ctx.when)
    rates = rates_of(prim, path, ctx)
    if rates is not None:
        return _moved_by(rates)
    if ctx.timing.is_frame or not moves(attribute, ctx.when, ctx.timing):
        return None
    return by_samples(prim, path, ctx)


def may_move(prim: ResolvedPrim, ctx: Context) -> bool:
    """Return whether the prim may have motion, a cheap test to make first; prims with velocities are moved by them at the
    frame, too."""
    if ctx.timing.is_frame:
        return not (ctx.when.is_default or VELOCITIES.isdisjoint(prim.names))
    return ctx.timing.is_timed


def by_samples(prim: ResolvedPrim, path: ArrayPath, ctx: Context) -> PointPath | None:
    """Return the motion by samples; None, and reported, if the number of values changes over the shutter."""
    here = path.at(0.0)
    times = bends([path.attribute], ctx.when, ctx.timing)
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
    problem = mismatch(velocities, points, around)
    start = None if around is None else points.sample(around[0])
    if problem or around is None or start is None or points.frame is None:
        note_unused(problem, name, prim, ctx)
        return None
    accelerations: Doubles | None = None
    if ACCELERATIONS in prim.names:
        further = ArrayPath(prim.prim.GetAttribute(ACCELERATIONS), 3, ctx.when)
        problem = mismatch(further, points, around)
        accelerations = None if problem else _doubles(further.sample(around[0]))
        note_unused(problem, ACCELERATIONS, prim, ctx)
    per_second = time_codes_per_second(ctx.stage)
    speeds = _doubles(velocities.sample(around[0]))
    return Rates(points.frame - around[0], per_second, start, speeds, accelerations)


def _doubles(rows: Rows | None) -> npt.NDArray[np.float64]:
    return np.zeros((0, 3)) if rows is None else rows.astype(np.float64)


def mismatch(found: ArrayPath, points: ArrayPath, around: tuple[float, float] | None) -> str:
    """Return why an attribute cannot be used with the points, or "" if it can."""
    if not has_times(found.attribute):
        return "they have no time samples"
    if around is None:
        return "the points have no time samples"
    if found.bracket() != around:
        return "their samples are at other times than those of the points"
    rows, start = found.sample(around[0]), points.sample(around[0])
    if rows is None or start is None or len(rows) != len(start):
        return "their number differs from that of the points"
    return ""


def note_unused(problem: str, name: str, prim: ResolvedPrim, ctx: Context) -> None:
    if problem and not ctx.timing.is_frame:
        ctx.warn("motion", prim.path, f"{name} are ignored: {problem}.", name)


def _moved_by(rates: Rates) -> PointPath:
    start = rates.start.astype(np.float64)

    def at(offset: float) -> Rows:
        return positions_after(rates, start, offset)

    return PointPath(at, (), acceleration_of(rates))


def positions_after(rates: Rates, start: Rows, offset: float) -> Doubles:
    """Return p + t (v + t a / 2) (UsdGeom's overview, "Applying Timesampled Velocities to Geometry")."""
    t = rates.seconds(offset)
    speeds = rates.velocities if rates.accelerations is None else rates.velocities + 0.5 * t * rates.accelerations
    return np.asarray(start + t * speeds)


def acceleration_of(rates: Rates) -> float:
    if rates.accelerations is None or not len(rates.accelerations):
        return 0.0
    return float(np.linalg.norm(rates.accelerations, axis=1).max()) / rates.per_second**2
