"""Sampling of moving instances for the description: all levels are multiplied out, at times chosen by an error bound in
pixels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...arrays import Doubles
from ...description import MatrixInstances, MatrixMotion, MotionSteps, MovingInstances
from ...description.instance_names import all_names
from ...description.placement import Box, Instances, Placement, named_levels, transformed_box
from .between import Turned, angles_between, have_rotations, taken_apart, turned
from .levels import do_move, product_at, times_of
from .pixels import Pixels
from .steps import Steps, corners_of, fractions, steps_of
from .timing import Timing

LOOKED_AT = 4096  # instances of a placement that are examined: those with the largest errors
WIDEST_TURN = np.radians(170.0)  # radians between two samples: the shorter direction must be unambiguous
PIXELS_NO_ERROR = 1e-3
SIZE_NO_ERROR = 1e-6  # of the swept extent
ROUNDING = 64 * 2.0**-52


@dataclass
class Precision:
    """Error measure for motion, and the samplings that were made by it."""

    timing: Timing
    pixels: Pixels
    most: float  # pixels
    steps: list[MotionSteps] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class MatrixPath:
    """K matrices over the exposure's span, with the scales that turn their errors into pixels."""

    at: Callable[[float], Doubles]  # fraction of the span -> (K, 3, 4)
    bends: Sequence[float]  # fractions of the span
    corners: Doubles  # (8, 3) of the bounding box of the prototype
    scales: Doubles  # (K,) pixels per unit of length
    no_error: float  # pixels


def settled(placement: Placement, blur_scale: float, box: Box, name: str, precision: Precision) -> Placement:
    """Return the placement with one level of moving instances if any of its levels moves, otherwise unchanged."""
    if not do_move(placement.levels):
        return placement
    moving = moving_instances(placement.levels, blur_scale, box, name, precision)
    return replace(placement, levels=(moving,))


def moving_instances(
    levels: Sequence[Instances], blur_scale: float, box: Box, name: str, precision: Precision
) -> MovingInstances | Instances:
    path = path_of(levels, blur_scale, box, precision)
    frame = product_at(levels, 0.0)
    if all(np.array_equal(path.at(time), frame) for time in (0.0, *path.bends, 0.5, 1.0) if 0.0 <= time <= 1.0):
        return MatrixInstances(frame, names=all_names(named_levels(levels)))
    motion, steps = motion_of(path, precision.most)
    precision.steps.append(steps.of(name, "instances", path.no_error))
    return MovingInstances(motion.times, motion.matrices, frame, motion.turns, names=all_names(named_levels(levels)))


def path_of(levels: Sequence[Instances], blur_scale: float, box: Box, precision: Precision) -> MatrixPath:
    timing = precision.timing
    known: dict[float, Doubles] = {}

    def at(fraction: float) -> Doubles:
        if fraction not in known:
            known[fraction] = product_at(levels, blur_scale * timing.offset(fraction))
        return known[fraction]

    bends = fractions(times_of(levels), timing.span, blur_scale)
    inside = sorted(time for time in bends if 0 < time < 1)
    swept = [transformed_box(at(time), box) for time in (0.0, *inside, 0.5, 1.0)]
    low, high = np.min([s[0] for s in swept], axis=0), np.max([s[1] for s in swept], axis=0)
    scales = precision.pixels.per_length(low, high)
    size = float((np.linalg.norm(high - low, axis=1) * scales).max())
    rounding = ROUNDING * float((np.maximum(np.abs(low), np.abs(high)).max(axis=1) * scales).max())
    return MatrixPath(at, bends, corners_of(*box), scales, max(min(PIXELS_NO_ERROR, SIZE_NO_ERROR * size), rounding))


def motion_of(path: MatrixPath, most: float, *, rigid: bool = False) -> tuple[MatrixMotion, Steps]:
    """Return the motion, interpolated linearly, or with turning rotations where that needs fewer samples; `rigid` motions turn
    unless they are pure translations."""
    straight = steps_of(_Straight(path).error, path.bends, most, path.no_error)
    chosen, turns = straight, False
    at_times = np.stack([path.at(time) for time in straight.times])
    must_turn = rigid and not (at_times[:, :, :, :3] == at_times[:1, :, :, :3]).all()
    if (must_turn or straight.segments > 1) and have_rotations(at_times):
        turning = steps_of(_Turning(path).error, path.bends, most, path.no_error)
        if must_turn or turning.segments < straight.segments or (turning.error < straight.error and straight.error > most):
            chosen, turns = turning, True
    times = np.array(chosen.times)
    return MatrixMotion(times, np.stack([path.at(time) for time in chosen.times]), turns), chosen


class _Straight:
    """Error of a path sampled with matrices that are linear between samples."""

    def __init__(self, path: MatrixPath) -> None:
        self._path = path
        self._looked_at = _most_moved(path)

    def error(self, a: float, b: float, time: float) -> float:
        u = (time - a) / (b - a)
        first, last = self._rows(a), self._rows(b)
        return self._difference(first + u * (last - first), time)

    def _rows(self, time: float) -> Doubles:
        rows = self._path.at(time)
        return rows if self._looked_at is None else rows[self._looked_at]

    def _difference(self, found: Doubles, time: float) -> float:
        """Return the largest error of any corner, in pixels."""
        apart = found - self._rows(time)
        moved = np.einsum("kij,cj->kci", apart[:, :, :3], self._path.corners) + apart[:, None, :, 3]
        scales = self._path.scales if self._looked_at is None else self._path.scales[self._looked_at]
        return float((np.linalg.norm(moved, axis=2).max(axis=1) * scales).max())


class _Turning(_Straight):
    """Error of a path sampled with rotations that turn between samples."""

    def __init__(self, path: MatrixPath) -> None:
        super().__init__(path)
        self._known: dict[float, Turned] = {}

    def error(self, a: float, b: float, time: float) -> float:
        first, last = self._apart(a), self._apart(b)
        if angles_between(first.quaternions, last.quaternions).max() > WIDEST_TURN:
            return float("inf")
        return self._difference(turned(first, last, (time - a) / (b - a)), time)

    def _apart(self, time: float) -> Turned:
        if time not in self._known:
            self._known[time] = taken_apart(self._rows(time))
        return self._known[time]


def _most_moved(path: MatrixPath) -> np.ndarray[tuple[int], np.dtype[np.intp]] | None:
    """Return the instances that move over the most pixels; None for all."""
    if len(path.scales) <= LOOKED_AT:
        return None
    moved = np.zeros(len(path.scales))
    for time in (0.2113, 0.5, 1.0):
        moved = np.maximum(moved, np.abs(path.at(time) - path.at(0.0)).max(axis=(1, 2)))
    return np.argsort(-moved * path.scales, kind="stable")[:LOOKED_AT]
