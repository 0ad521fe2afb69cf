"""Motion of instances as the description has it: all levels multiplied out and sampled at times chosen by an error bound in
pixels, and matrices interpolated between two times as the core does it (description/motion.py).

A matrix is decomposed into a rotation and a symmetric stretch (polar decomposition). For mirroring matrices the rotation is
that of the matrix times -1, and the stretch is negative.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...arrays import Doubles
from ...description import MatrixInstances, MatrixMotion, MotionSteps, MovingInstances
from ...description.placement import Box, Instances, Placement, all_names, named_levels, put_rotations, transformed_box
from .levels import Rows, any_moves, product_at, times_of
from .sample_times import Steps, corners_of, fractions, sample_times
from .timing import Pixels, Timing

MOST_EXAMINED = 4096  # instances of a placement that are examined: those with the largest errors
WIDEST_TURN = np.radians(170.0)  # radians between two samples: the shorter direction must be unambiguous
PIXELS_NO_ERROR = 1e-3
SIZE_NO_ERROR = 1e-6  # of the swept extent
ROUNDING = 64 * 2.0**-52


@dataclass
class MotionPrecision:
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


def with_sampled_motion(placement: Placement, blur_scale: float, box: Box, name: str, precision: MotionPrecision) -> Placement:
    """Return the placement with one level of moving instances if any of its levels moves, otherwise unchanged."""
    if not any_moves(placement.levels):
        return placement
    moving = sampled_instances(placement.levels, blur_scale, box, name, precision)
    return replace(placement, levels=(moving,))


def sampled_instances(
    levels: Sequence[Instances], blur_scale: float, box: Box, name: str, precision: MotionPrecision
) -> MovingInstances | Instances:
    path = matrix_path(levels, blur_scale, box, precision)
    frame = product_at(levels, 0.0)
    if stays_at(path, frame):
        return MatrixInstances(frame, names=all_names(named_levels(levels)))
    motion, steps = sampled_motion(path, precision.most)
    precision.steps.append(steps.of(name, "instances", path.no_error))
    return MovingInstances(motion.times, motion.matrices, frame, motion.turns, names=all_names(named_levels(levels)))


def matrix_path(levels: Sequence[Instances], blur_scale: float, box: Box, precision: MotionPrecision) -> MatrixPath:
    return path_of_rows(lambda offset: product_at(levels, offset), times_of(levels), blur_scale, box, precision)


def path_of_rows(rows_at: Rows, times: Sequence[float], blur_scale: float, box: Box, precision: MotionPrecision) -> MatrixPath:
    """Return the path of matrices (K, 3, 4) that place a box; `times`: the offsets from the frame at which it may bend."""
    timing = precision.timing
    known: dict[float, Doubles] = {}

    def at(fraction: float) -> Doubles:
        if fraction not in known:
            known[fraction] = rows_at(blur_scale * timing.offset(fraction))
        return known[fraction]

    bends = fractions(times, timing.span, blur_scale)
    inside = sorted(time for time in bends if 0 < time < 1)
    swept = [transformed_box(at(time), box) for time in (0.0, *inside, 0.5, 1.0)]
    low, high = np.min([s[0] for s in swept], axis=0), np.max([s[1] for s in swept], axis=0)
    scales = precision.pixels.per_length(low, high)
    size = float((np.linalg.norm(high - low, axis=1) * scales).max())
    rounding = ROUNDING * float((np.maximum(np.abs(low), np.abs(high)).max(axis=1) * scales).max())
    return MatrixPath(at, bends, corners_of(*box), scales, max(min(PIXELS_NO_ERROR, SIZE_NO_ERROR * size), rounding))


def stays_at(path: MatrixPath, frame: Doubles) -> bool:
    """Return whether all matrices are those of the frame (K, 3, 4) at all times."""
    return all(np.array_equal(path.at(time), frame) for time in (0.0, *path.bends, 0.5, 1.0) if 0.0 <= time <= 1.0)


def sampled_motion(path: MatrixPath, most: float, *, rigid: bool = False) -> tuple[MatrixMotion, Steps]:
    """Return the motion, interpolated linearly, or with turning rotations where that needs fewer samples; `rigid` motions turn
    unless they are pure translations."""
    straight = sample_times(_LinearError(path).error, path.bends, most, path.no_error)
    chosen, turns = straight, False
    at_times = np.stack([path.at(time) for time in straight.times])
    must_turn = rigid and not (at_times[:, :, :, :3] == at_times[:1, :, :, :3]).all()
    if (must_turn or straight.segments > 1) and have_rotations(at_times):
        turning = sample_times(_RotatingError(path).error, path.bends, most, path.no_error)
        if must_turn or turning.segments < straight.segments or (turning.error < straight.error and straight.error > most):
            chosen, turns = turning, True
    times = np.array(chosen.times)
    return MatrixMotion(times, np.stack([path.at(time) for time in chosen.times]), turns), chosen


class _LinearError:
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


class _RotatingError(_LinearError):
    """Error of a path sampled with rotations that turn between samples."""

    def __init__(self, path: MatrixPath) -> None:
        super().__init__(path)
        self._known: dict[float, PolarMatrices] = {}

    def error(self, a: float, b: float, time: float) -> float:
        first, last = self._apart(a), self._apart(b)
        if angles_between(first.quaternions, last.quaternions).max() > WIDEST_TURN:
            return float("inf")
        return self._difference(interpolated_matrices(first, last, (time - a) / (b - a)), time)

    def _apart(self, time: float) -> PolarMatrices:
        if time not in self._known:
            self._known[time] = polar_decomposition(self._rows(time))
        return self._known[time]


def _most_moved(path: MatrixPath) -> np.ndarray[tuple[int], np.dtype[np.intp]] | None:
    """Return the instances that move over the most pixels; None for all."""
    if len(path.scales) <= MOST_EXAMINED:
        return None
    moved = np.zeros(len(path.scales))
    for time in (0.2113, 0.5, 1.0):
        moved = np.maximum(moved, np.abs(path.at(time) - path.at(0.0)).max(axis=(1, 2)))
    return np.argsort(-moved * path.scales, kind="stable")[:MOST_EXAMINED]


FLAT = 1e-9  # of the largest stretch: below, the rotation is undefined


@dataclass(frozen=True, eq=False)
class PolarMatrices:
    """Polar decomposition of K matrices."""

    quaternions: Doubles  # (K, 4): x, y, z, w
    stretches: Doubles  # (K, 3, 3), symmetric
    translations: Doubles  # (K, 3)


def have_rotations(matrices: Doubles) -> bool:
    """Return whether all matrices (S + 1, K, 3, 4) have well-defined rotations, and none changes between mirroring and not
    mirroring."""
    linear = matrices[..., :3]
    sizes = np.linalg.svd(linear, compute_uv=False)
    if not (sizes[..., 2] > FLAT * sizes[..., 0]).all():
        return False
    mirrors = np.linalg.det(linear) < 0
    return bool((mirrors == mirrors[:1]).all())


def polar_decomposition(matrices: Doubles) -> PolarMatrices:
    """Return the polar decomposition of matrices (K, 3, 4) that have rotations."""
    u, sizes, v = np.linalg.svd(matrices[:, :, :3])
    rotations = u @ v
    signs = np.sign(np.linalg.det(rotations))
    stretches = v.transpose(0, 2, 1) @ (sizes[:, :, None] * v) * signs[:, None, None]
    return PolarMatrices(quaternions(rotations * signs[:, None, None]), stretches, matrices[:, :, 3])


def interpolated_matrices(a: PolarMatrices, b: PolarMatrices, u: float) -> Doubles:
    """Return matrices (K, 3, 4) between two: rotations turn the shorter way at constant speed, the rest is linear."""
    rotations = rotation_matrices(slerp(a.quaternions, b.quaternions, u))
    linear = rotations @ (a.stretches + u * (b.stretches - a.stretches))
    return np.concatenate([linear, (a.translations + u * (b.translations - a.translations))[:, :, None]], axis=2)


def slerp(a: Doubles, b: Doubles, u: float) -> Doubles:
    """Return unit quaternions (K, 4) between `a` and `b`, the shorter way."""
    cosines = np.sum(a * b, axis=1)
    b = np.where(cosines[:, None] < 0, -b, b)
    # The half-angle formula is exact for small angles, too.
    angles = 2.0 * np.arctan2(np.linalg.norm(b - a, axis=1), np.linalg.norm(b + a, axis=1))
    sines = np.sin(angles)
    small = sines < 1e-9
    safe = np.where(small, 1.0, sines)
    from_a = np.where(small, 1.0 - u, np.sin((1.0 - u) * angles) / safe)
    from_b = np.where(small, u, np.sin(u * angles) / safe)
    mixed = from_a[:, None] * a + from_b[:, None] * b
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def angles_between(a: Doubles, b: Doubles) -> Doubles:
    """Return the angles (K,) between rotations given as quaternions, in radians."""
    b = np.where(np.sum(a * b, axis=1)[:, None] < 0, -b, b)
    return np.asarray(4.0 * np.arctan2(np.linalg.norm(b - a, axis=1), np.linalg.norm(b + a, axis=1)))


def quaternions(r: Doubles) -> Doubles:
    """Return quaternions (K, 4) of rotation matrices (K, 3, 3), by the largest component to avoid cancellation (Shepperd
    1978)."""
    trace = np.trace(r, axis1=1, axis2=2)
    diagonal = r[:, [0, 1, 2], [0, 1, 2]]
    found = np.empty((4, len(r), 4))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[i][:, i] = 1.0 - trace + 2.0 * diagonal[:, i]
        found[i][:, j] = r[:, j, i] + r[:, i, j]
        found[i][:, k] = r[:, k, i] + r[:, i, k]
        found[i][:, 3] = r[:, k, j] - r[:, j, k]
        found[3][:, i] = r[:, k, j] - r[:, j, k]
    found[3][:, 3] = 1.0 + trace
    largest = np.argmax(np.concatenate([diagonal, trace[:, None]], axis=1), axis=1)
    chosen = found[largest, np.arange(len(r))]
    return np.asarray(chosen / np.linalg.norm(chosen, axis=1, keepdims=True))


def rotation_matrices(q: Doubles) -> Doubles:
    """Return rotation matrices (K, 3, 3) of unit quaternions."""
    made = np.empty((len(q), 3, 3))
    put_rotations(made, q, 2.0)
    return made
