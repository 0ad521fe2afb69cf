"""Veiling glare: light that is scattered far, falling with the square of the distance.

It follows Stiles and Holladay's law of disability glare, 10 E / theta^2 (Vos 1984, "Disability glare - a state of the art
report"), with a plateau in the middle as in Spencer et al. 1995, "Physically-based glare effects for digital images". Its
integral diverges, so it is cut off at the frame's size.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Doubles
from .grid import Axis, Grid

# Pixels within CORE of the middle are averages over POINTS x POINTS points; others are evaluated at their centres.
CORE, POINTS = 4, 16


def glare(grid: Grid, width: float) -> Doubles:
    """Return a kernel of sum 1 over all pixels within reach; `width`, in pixels, is the radius of the plateau."""
    y, x = _positions(grid.y), _positions(grid.x)
    quarter = _falloff(y[:, None], x[None, :], width)
    _refine(quarter, grid, width)
    # Weights of the quarter in the sum of all four: elements on an axis are shared by two, the middle by all.
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
