"""Motion of a point instancer's instances over the shutter, as in USD's ComputeInstanceTransformsAtTimes.

Where velocities or angular velocities apply, nothing is interpolated: positions, orientations and scales are those of the
sample at or before the frame, advanced by the velocities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ..scene.context import Context
from ..scene.inheritance import ResolvedPrim
from ..stage.metadata import time_codes_per_second
from .arrays import ArrayPath, Rows
from .changes import bends, moves
from .points import may_move, mismatch, note_unused, positions_after, rates_of

ANGULAR = "angularVelocities"


@dataclass(frozen=True, eq=False)
class Parts:
    """Positions, orientations and scales of instances at one time."""

    positions: Rows  # (K, 3)
    orientations: Rows | None  # (K, 4): x, y, z, w
    scales: Rows | None  # (K, 3)


@dataclass(frozen=True, eq=False)
class InstancerPath:
    at: Callable[[float], Parts]  # offset from the frame -> Parts
    times: tuple[float, ...]  # offsets at which paths may bend


def instancer_path(prim: ResolvedPrim, frame: Parts, ctx: Context) -> InstancerPath | None:
    """Return the instances' motion; None if they keep the values `frame`, read at the frame."""
    if not may_move(prim, ctx):
        return None
    paths = {
        name: ArrayPath(prim.prim.GetAttribute(name), columns, ctx.when)
        for name, columns in (("positions", 3), (_name_of_orientations(prim, frame), 4), ("scales", 3))
        if name in prim.names
    }
    by_rates = _by_rates(prim, frame, paths, ctx)
    if by_rates is not None or ctx.timing.is_frame:
        return by_rates
    return _by_samples(prim, frame, paths, ctx)


def _name_of_orientations(prim: ResolvedPrim, frame: Parts) -> str:
    """Return the attribute that is used: `orientationsf` if it fits."""
    if frame.orientations is None:
        return ""
    both = {"orientations", "orientationsf"} <= prim.names
    return (
        "orientationsf"
        if "orientationsf" in prim.names and (not both or frame.orientations.dtype == np.float32)
        else "orientations"
    )


def _by_samples(prim: ResolvedPrim, frame: Parts, paths: dict[str, ArrayPath], ctx: Context) -> InstancerPath | None:
    moving = {name: path for name, path in paths.items() if moves(path.attribute, ctx.when, ctx.timing)}
    if not moving:
        return None
    times = bends([path.attribute for path in moving.values()], ctx.when, ctx.timing)
    first, last = ctx.timing.looked_at
    count = len(frame.positions)
    for name, path in list(moving.items()):
        lengths = {None if rows is None else len(rows) for rows in map(path.at, (first, last, 0.0, *times))}
        if lengths != {count}:
            what = "its instances are" if name == "positions" else f"{name} are"
            message = f"{what} not blurred: the number of {name} changes while the shutter is open."
            ctx.warn("motion", prim.path, message[0].upper() + message[1:], name)
            del moving[name]
            if name == "positions":
                return None
    if not moving:
        return None

    def part(offset: float, name: str, here: Rows | None) -> Rows | None:
        found = moving[name].at(offset) if name in moving else None
        return here if found is None or here is None else found

    orientations = _name_of_orientations(prim, frame)

    def at(offset: float) -> Parts:
        positions = part(offset, "positions", frame.positions)
        return Parts(
            frame.positions if positions is None else positions,
            part(offset, orientations, frame.orientations),
            part(offset, "scales", frame.scales),
        )

    return InstancerPath(at, tuple(times))


@dataclass(frozen=True, eq=False)
class _Spin:
    """Rotation by angular velocities from the sample at or before the frame."""

    since: float
    per_second: float
    start: Rows
    degrees: Doubles  # (K, 3) per second


def _by_rates(prim: ResolvedPrim, frame: Parts, paths: dict[str, ArrayPath], ctx: Context) -> InstancerPath | None:
    positions, orientations = paths.get("positions"), paths.get(_name_of_orientations(prim, frame))
    rates = None if positions is None else rates_of(prim, positions, ctx)
    spin = _spin_of(prim, orientations, ctx)
    if (rates is None and spin is None) or positions is None:
        return None
    since = rates.since if rates is not None else spin.since if spin is not None else 0.0
    count = len(frame.positions)
    held = {name: _of_length(path.at(-since), count) for name, path in paths.items()}
    start = held["positions"]
    if start is None or (spin is not None and len(spin.start) != count):
        return None
    turned = None if orientations is None else held[_name_of_orientations(prim, frame)]
    scales = held.get("scales", frame.scales)

    def at(offset: float) -> Parts:
        moved = start if rates is None else positions_after(rates, start, offset)
        return Parts(moved, turned if spin is None else _spun(spin, offset), scales)

    return InstancerPath(at, ())


def _of_length(rows: Rows | None, count: int) -> Rows | None:
    return rows if rows is not None and len(rows) == count else None


def _spin_of(prim: ResolvedPrim, orientations: ArrayPath | None, ctx: Context) -> _Spin | None:
    if ANGULAR not in prim.names:
        return None
    path = ArrayPath(prim.prim.GetAttribute(ANGULAR), 3, ctx.when)
    around = None if orientations is None else orientations.bracket()
    problem = "there are no orientations" if orientations is None else mismatch(path, orientations, around)
    if problem or around is None or orientations is None or orientations.frame is None:
        note_unused(problem, ANGULAR, prim, ctx)
        return None
    start, degrees = orientations.sample(around[0]), path.sample(around[0])
    if start is None or degrees is None:
        return None
    return _Spin(orientations.frame - around[0], time_codes_per_second(ctx.stage), start, degrees.astype(np.float64))


def _spun(spin: _Spin, offset: float) -> Doubles:
    """Return orientations (K, 4), turned about the instancer's axes after the authored orientation."""
    seconds = (spin.since + offset) / spin.per_second
    speed = np.linalg.norm(spin.degrees, axis=1)
    half = np.radians(speed) * seconds / 2.0
    axis = spin.degrees / np.where(speed > 0, speed, 1.0)[:, None]
    turn = np.concatenate([axis * np.sin(half)[:, None], np.cos(half)[:, None]], axis=1)
    return _product(turn, spin.start.astype(np.float64))


def _product(a: Doubles, b: Doubles) -> Doubles:
    """Return the product (K, 4) of quaternions x, y, z, w: `b` first, then `a`."""
    va, wa, vb, wb = a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]
    vector = wa * vb + wb * va + np.cross(va, vb)
    return np.concatenate([vector, wa * wb - np.sum(va * vb, axis=1, keepdims=True)], axis=1)
