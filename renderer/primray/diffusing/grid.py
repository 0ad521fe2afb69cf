"""Where a point's light may go: the pixels about it, as far as light travels, and those of them that a window needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles


@dataclass(frozen=True)
class Axis:
    """Pixels along one side of a picture, by their distance from the point whose light it is, in units of a pixel's height."""

    reach: int  # pixels on either side that light comes to: those of the whole frame, so that no crop changes what is there
    window: int  # pixels on either side that are wanted: those of the data window
    size: float  # of a pixel

    @property
    def near(self) -> int:
        """What is both wanted and come to."""
        return min(self.reach, self.window)


@dataclass(frozen=True)
class Grid:
    """Kernels are arrays (2 window - 1, 2 window - 1), the point in the middle."""

    y: Axis
    x: Axis
    height: int  # of the whole frame: what widths are shares of

    @property
    def shape(self) -> tuple[int, int]:
        return 2 * self.y.window - 1, 2 * self.x.window - 1

    def widened(self, kernel: Doubles) -> Doubles:
        """0 where no light comes to: a kernel of odd sides, no larger than the grid's shape, to that."""
        beyond = [((whole - side) // 2,) * 2 for whole, side in zip(self.shape, kernel.shape, strict=True)]
        return np.pad(kernel, beyond) if any(map(any, beyond)) else kernel


def grid_of(resolution: tuple[int, int], size: tuple[int, int], pixel_aspect_ratio: float = 1.0) -> Grid:
    """For a window of `size` (width, height) pixels in a frame of `resolution`."""
    return Grid(Axis(resolution[1], size[1], 1.0), Axis(resolution[0], size[0], pixel_aspect_ratio), resolution[1])
