"""The seam's motion: how shapes, instances, lights and the camera stand at times of an exposure. Part of description.py.

Times are fractions of the exposure's span, which ascend from 0 to 1; what is given at S + 1 of them has S segments. Between two
times points are linear, and so are matrices, unless they turn: then their rotations go the shorter way at constant speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles, Floats
from ..camera import Camera

SAME_TIME = 1e-7  # of the span


@dataclass(frozen=True)
class Exposure:
    """When rays see the scene, in time codes from the frame on: uniformly from `opens` to `closes`, within the span."""

    opens: float
    closes: float
    span: tuple[float, float]  # what motion is given for: the shutter, and the frame (0) where AOVs are asked for
    # How much later it is for each column and row of the frame, from the upper left: of a shutter that rolls.
    per_column: float = 0.0
    per_row: float = 0.0

    def fraction(self, offset: float) -> float:
        """Of the span, of a time in time codes from the frame on."""
        first, last = self.span
        return (offset - first) / (last - first)

    @property
    def shutter(self) -> tuple[float, float]:
        """Fractions of the span."""
        return self.fraction(self.opens), self.fraction(self.closes)

    @property
    def rolling(self) -> tuple[float, float]:
        """The same for each column and row."""
        first, last = self.span
        return self.per_column / (last - first), self.per_row / (last - first)

    @property
    def frame(self) -> float:
        """The frame's fraction of the span, or the nearest that is within."""
        return min(max(self.fraction(0.0), 0.0), 1.0)


@dataclass(frozen=True, eq=False)
class PointMotion:
    """A mesh's points at other times than the frame."""

    times: Doubles  # (S + 1,)
    points: Floats  # (S + 1, N, 3), as Mesh.points
    normals: Floats | None = None  # (S + 1, M, 3), as Mesh.normals; None: they stay as they are, or there are none


@dataclass(frozen=True, eq=False)
class MatrixMotion:
    """Matrices at times."""

    times: Doubles  # (S + 1,)
    matrices: Doubles  # (S + 1, 4, 4)
    turns: bool = False  # between times rotations go the shorter way at constant speed, the rest is linear; else all is linear


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """A camera at times: its rotation turns at constant speed, the rest is linear between them."""

    times: Doubles  # (S + 1,)
    cameras: tuple[Camera, ...]  # S + 1, alike in projection, blades and clipping planes


@dataclass(frozen=True)
class MotionSteps:
    """For reports: at how many times the path of one thing is given, and why."""

    path: str
    kind: str  # instances, meshes, lights or camera
    segments: int
    by_error: bool  # they are more than the stage's own samples ask for, for the sake of the error
    error: float  # pixels: the largest that is left


def segment_of(times: Doubles, fraction: float) -> tuple[int, float]:
    """The segment that a fraction of the span is in, and how much of it lies before."""
    k = int(np.clip(np.searchsorted(times, fraction, side="right") - 1, 0, len(times) - 2))
    return k, float((fraction - times[k]) / (times[k + 1] - times[k]))


def is_uniform(times: Sequence[float] | Doubles) -> bool:
    """Whether all segments are of one length, but for rounding. Decided here alone: the core is given `handed_over`."""
    return bool(np.abs(np.asarray(times, np.float64) - _even(len(times))).max() < SAME_TIME) if len(times) > 1 else False


def handed_over(times: Sequence[float] | Doubles) -> Floats:
    """In single precision, as the core takes times: even ones exactly so, by which it knows them."""
    return np.asarray(_even(len(times)) if is_uniform(times) else times).astype(np.float32)


def _even(count: int) -> Doubles:
    return np.arange(count) / max(count - 1, 1)
