"""Extent of kernels: the pixels around a point within reach of its light, and those that the data window needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles


@dataclass(frozen=True)
class Axis:
    """Extent of a kernel along one axis, in pixels."""

    reach: int  # pixels on either side within reach: those of the whole frame, so that a crop does not change the kernel
    window: int  # pixels on either side that are needed: those of the data window
    size: float  # of a pixel, in units of its height

    @property
    def near(self) -> int:
        """Pixels on either side that are both needed and within reach."""
        return min(self.reach, self.window)


@dataclass(frozen=True)
class Grid:
    """Extent of kernels, which are arrays (2 y.window - 1, 2 x.window - 1) with the point in the middle."""

    y: Axis
    x: Axis
    height: int  # of the whole frame, of which widths are fractions

    @property
    def shape(self) -> tuple[int, int]:
        return 2 * self.y.window - 1, 2 * self.x.window - 1

    def widened(self, kernel: Doubles) -> Doubles:
        """Return a kernel of odd sides, no larger than the grid's shape, padded with zeros to that shape."""
        beyond = [((whole - side) // 2,) * 2 for whole, side in zip(self.shape, kernel.shape, strict=True)]
        return np.pad(kernel, beyond) if any(map(any, beyond)) else kernel


def grid_of(resolution: tuple[int, int], size: tuple[int, int], pixel_aspect_ratio: float = 1.0) -> Grid:
    """Return the grid for a window of `size` (width, height) pixels in a frame of `resolution`."""
    return Grid(Axis(resolution[1], size[1], 1.0), Axis(resolution[0], size[0], pixel_aspect_ratio), resolution[1])
