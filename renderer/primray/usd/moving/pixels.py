"""How many pixels a length in the world may come to, by the camera and how near things come to it: never too few."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ...description import Camera, Projection

NEAREST = 1e-3  # of the way to a box's centre: what holds the camera counts as no nearer


@dataclass(frozen=True, eq=False)
class Pixels:
    eyes: Doubles  # (C, 3) where the camera stands, at some times
    per_unit: float  # at distance 1; everywhere where the projection is parallel
    nearest: float  # its near plane
    is_parallel: bool

    def per_length(self, low: Doubles, high: Doubles) -> Doubles:
        """(K,) pixels a unit of length, at most, of what is within the boxes (K, 3)."""
        if self.is_parallel:
            return np.full(len(low), self.per_unit)
        apart = np.maximum(np.maximum(low[:, None] - self.eyes, self.eyes - high[:, None]), 0.0)
        to_center = np.linalg.norm((low + high)[:, None] / 2 - self.eyes, axis=2)
        distance = np.maximum(np.linalg.norm(apart, axis=2), np.maximum(NEAREST * to_center, self.nearest))
        with np.errstate(divide="ignore"):
            return np.asarray(self.per_unit / distance.min(axis=1))


def pixels_of(cameras: Sequence[Camera], resolution: tuple[int, int]) -> Pixels:
    """By one or more cameras that are alike but for where they stand and how far they zoom."""
    per_unit = 0.0
    is_parallel = cameras[0].projection is Projection.ORTHOGRAPHIC
    for camera in cameras:
        left, right, bottom, top = camera.window
        finest = max(resolution[0] / abs(right - left), resolution[1] / abs(top - bottom))
        # Away from the axis depth is less than distance, and moves along the ray count too: each by 1 / cos.
        slope = 0.0 if is_parallel else max(abs(left), abs(right)) ** 2 + max(abs(bottom), abs(top)) ** 2
        per_unit = max(per_unit, finest * (1.0 + slope))
    eyes = np.array([camera.world_from_camera[:3, 3] for camera in cameras])
    return Pixels(eyes, per_unit, max(cameras[0].clipping_range[0], 1e-30), is_parallel)
