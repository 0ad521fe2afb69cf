"""Motion in a scene description: shapes, instances, lights and the camera at times of an exposure.

Times are fractions of the exposure's span, ascending from 0 to 1; S + 1 of them make S segments. Between two times points are
linear, and so are matrices, unless they turn: then rotations take the shorter way at constant speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Doubles, Floats

if TYPE_CHECKING:
    from ..camera import Camera

SAME_TIME = 1e-7  # of the span


@dataclass(frozen=True)
class Exposure:
    """Interval in which rays see the scene, in time codes from the frame: uniformly from `opens` to `closes`, within the
    span."""

    opens: float
    closes: float
    span: tuple[float, float]  # interval for which motion is given: the shutter, and the frame (0) if AOVs need it
    # Delay for each column and row of the frame, from the upper left, of a rolling shutter.
    per_column: float = 0.0
    per_row: float = 0.0

    def fraction(self, offset: float) -> float:
        """Return the fraction of the span for a time in time codes from the frame."""
        first, last = self.span
        return (offset - first) / (last - first)

    @property
    def shutter(self) -> tuple[float, float]:
        """Opening and closing time as fractions of the span."""
        return self.fraction(self.opens), self.fraction(self.closes)

    @property
    def rolling(self) -> tuple[float, float]:
        """Delay per column and per row as fractions of the span."""
        first, last = self.span
        return self.per_column / (last - first), self.per_row / (last - first)

    @property
    def frame(self) -> float:
        """Fraction of the span at the frame, clamped to [0, 1]."""
        return min(max(self.fraction(0.0), 0.0), 1.0)


@dataclass(frozen=True, eq=False)
class PointMotion:
    """Points of a shape at times of the exposure."""

    times: Doubles  # (S + 1,)
    points: Floats  # (S + 1, N, 3), as Mesh.points
    normals: Floats | None = None  # (S + 1, M, 3), as Mesh.normals; None: unchanged, or there are none


@dataclass(frozen=True, eq=False)
class MatrixMotion:
    """Matrices at times of the exposure."""

    times: Doubles  # (S + 1,)
    matrices: Doubles  # (S + 1, 4, 4); of N instances (S + 1, N, 3, 4)
    turns: bool = False  # rotations take the shorter way at constant speed, the rest is linear; else everything is linear


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """Cameras at times of the exposure: rotations turn at constant speed, the rest is linear in between."""

    times: Doubles  # (S + 1,)
    cameras: tuple[Camera, ...]  # S + 1, equal in projection, blades and clipping planes


@dataclass(frozen=True)
class MotionSteps:
    """Report entry: the number of times at which one path is sampled, and why."""

    path: str
    kind: str  # instances, meshes, lights or camera
    segments: int
    by_error: bool  # more than the stage's own samples require, because of the error
    error: float  # pixels: the largest remaining


def segment_of(times: Doubles, fraction: float) -> tuple[int, float]:
    """Return the segment that contains a fraction of the span, and the position within it (0 to 1)."""
    k = int(np.clip(np.searchsorted(times, fraction, side="right") - 1, 0, len(times) - 2))
    return k, float((fraction - times[k]) / (times[k + 1] - times[k]))


def is_uniform(times: Sequence[float] | Doubles) -> bool:
    """Return whether all segments have the same length, up to rounding. This is decided here alone: the core gets the times
    from `handed_over`."""
    return bool(np.abs(np.asarray(times, np.float64) - _even(len(times))).max() < SAME_TIME) if len(times) > 1 else False


def handed_over(times: Sequence[float] | Doubles) -> Floats:
    """Return the times in single precision for the core; even ones exactly even, by which the core recognises them."""
    return np.asarray(_even(len(times)) if is_uniform(times) else times).astype(np.float32)


def _even(count: int) -> Doubles:
    return np.arange(count) / max(count - 1, 1)
