"""The veil: light that is scattered far, falling with the square of the distance.

Stiles and Holladay's law of disability glare, 10 E / theta^2 (Vos 1984, "Disability glare - a state of the art report").
Spencer et al. 1995, "Physically-based glare effects for digital images", flatten it about its middle, as is done here. Its
integral has no limit, so that it ends at the frame's size.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Doubles
from .grid import Axis, Grid

# About the middle, pixels are averages of so many points a side; farther off the middle of a pixel stands for it.
CORE, POINTS = 4, 16


def glare(grid: Grid, width: float) -> Doubles:
    """A kernel of sum 1 over all that light comes to; `width`, in pixels, is where the middle's plateau ends."""
    y, x = _positions(grid.y), _positions(grid.x)
    quarter = _falloff(y[:, None], x[None, :], width)
    _refine(quarter, grid, width)
    # All four quarters: what lies on an axis belongs to two of them, the middle to all.
    weights_y, weights_x = np.full(len(y), 2.0), np.full(len(x), 2.0)
    weights_y[0] = weights_x[0] = 1.0
    quarter /= weights_y @ quarter @ weights_x
    near = quarter[: grid.y.near, : grid.x.near]
    half = np.concatenate([near[:0:-1], near])
    return grid.widened(np.concatenate([half[:, :0:-1], half], axis=1))


def _positions(axis: Axis) -> Doubles:
    return np.arange(axis.reach, dtype=np.float64) * axis.size


def _falloff(y: Doubles, x: Doubles, width: float) -> Doubles:
    density: Doubles = (np.hypot(y, x) + width) ** -2.0
    return density


def _refine(quarter: Doubles, grid: Grid, width: float) -> None:
    within = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    for i, j in np.ndindex(quarter[:CORE, :CORE].shape):
        y, x = (i + within) * grid.y.size, (j + within) * grid.x.size
        quarter[i, j] = _falloff(y[:, None], x[None, :], width).mean()
