"""Shutter times, the range of stage time to examine for them, and a bound on the pixels that a world-space length covers.

Times are in time codes relative to the frame. The bound follows from the camera and the distance of objects to it. Both are
known before skeletons pose anything (`Foreseen`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ...description import Camera, Exposure, Projection


@dataclass(frozen=True)
class Rolling:
    """Rolling shutter, in time codes relative to the frame."""

    opens: float  # `opens` and `closes` are those of the frame's first row and column
    closes: float
    per_column: float
    per_row: float


@dataclass(frozen=True)
class Timing:
    """Shutter of one frame; one that closes when it opens makes a still at that instant. The defaults are a still at the frame.

    `blur_scale` is the largest motion:blurScale on the stage, which widens the range of time to examine. `is_timed`: the stage
    may have time samples at all (splines excepted, which no layer lists).
    """

    opens: float = 0.0
    closes: float = 0.0
    with_frame: bool = False  # the frame's instant is needed, too, for AOVs
    is_timed: bool = False
    blur_scale: float = 1.0
    vectors: tuple[float, float] | None = None  # of a still: shutter interval for motion vectors
    rolling: Rolling | None = None  # within `opens` and `closes`, those of the first and the last line

    @property
    def is_open(self) -> bool:
        """Whether motion is described at all."""
        return self.opens < self.closes or self.vectors is not None

    @property
    def is_frame(self) -> bool:
        """Whether everything is seen as it is at the frame."""
        return self.opens == self.closes == 0.0 and self.vectors is None

    @property
    def span(self) -> tuple[float, float]:
        """Interval for which motion is described."""
        opens, closes = self.vectors or (self.opens, self.closes)
        if self.is_open and self.with_frame:
            return min(opens, self.opens, 0.0), max(closes, self.closes, 0.0)
        return opens, closes

    @property
    def looked_at(self) -> tuple[float, float]:
        """Interval in which changes matter; it includes the frame, from which stills may differ."""
        first, last = self.span
        return min(first * self.blur_scale, 0.0), max(last * self.blur_scale, 0.0)

    def offset(self, fraction: float) -> float:
        """Return the offset from the frame for a fraction of the span."""
        first, last = self.span
        return last if fraction == 1.0 else first + fraction * (last - first)

    @property
    def exposure(self) -> Exposure:
        if (rolling := self.rolling) is not None:
            return Exposure(rolling.opens, rolling.closes, self.span, rolling.per_column, rolling.per_row)
        return Exposure(self.opens, self.closes, self.span)


AT_FRAME = Timing()


NEAREST = 1e-3  # of the distance to a box's centre: the nearest distance of boxes around the camera


@dataclass(frozen=True, eq=False)
class Pixels:
    eyes: Doubles  # (C, 3) camera positions at some times
    per_unit: float  # pixels per unit at distance 1, or everywhere for parallel projections
    nearest: float  # distance of the near plane
    is_parallel: bool

    def per_length(self, low: Doubles, high: Doubles) -> Doubles:
        """Return the largest number of pixels per unit of length (K,) within boxes (K, 3)."""
        if self.is_parallel:
            return np.full(len(low), self.per_unit)
        apart = np.maximum(np.maximum(low[:, None] - self.eyes, self.eyes - high[:, None]), 0.0)
        to_center = np.linalg.norm((low + high)[:, None] / 2 - self.eyes, axis=2)
        distance = np.maximum(np.linalg.norm(apart, axis=2), np.maximum(NEAREST * to_center, self.nearest))
        with np.errstate(divide="ignore"):
            return np.asarray(self.per_unit / distance.min(axis=1))


def pixels_of(cameras: Sequence[Camera], resolution: tuple[int, int]) -> Pixels:
    """Return the bound for one or more cameras that differ only in position, orientation and zoom."""
    per_unit = 0.0
    is_parallel = cameras[0].projection is Projection.ORTHOGRAPHIC
    for camera in cameras:
        left, right, bottom, top = camera.window
        finest = max(resolution[0] / abs(right - left), resolution[1] / abs(top - bottom))
        # Off the axis depth is less than distance, and motion along the ray counts, too: a factor 1 / cos for each.
        slope = 0.0 if is_parallel else max(abs(left), abs(right)) ** 2 + max(abs(bottom), abs(top)) ** 2
        per_unit = max(per_unit, finest * (1.0 + slope))
    eyes = np.array([camera.world_from_camera[:3, 3] for camera in cameras])
    return Pixels(eyes, per_unit, max(cameras[0].clipping_range[0], 1e-30), is_parallel)


@dataclass(frozen=True, eq=False)
class Foreseen:
    """Timing and error bound of the render, and the camera's pixels if it is known."""

    timing: Timing = AT_FRAME
    most: float = 1.0  # largest motion error in pixels
    pixels: Pixels | None = None  # None: the camera is made once the scene is translated
    side: int = 1  # longer side of the image, in pixels

    def per_length(self, low: Doubles, high: Doubles, is_placed: bool = True) -> Doubles:
        """Return pixels per unit of length (K,) within the boxes (K, 3); without a known camera or placement, as if each box
        filled the image."""
        if self.pixels is not None and is_placed:
            return self.pixels.per_length(low, high)
        size = np.linalg.norm(high - low, axis=1)
        return np.asarray(self.side / np.where(size > 0.0, size, 1.0))


UNSEEN = Foreseen()
