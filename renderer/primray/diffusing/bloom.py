"""Bloom around bright pixels: a sum of Gaussians, integrated over pixels."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Doubles
from .grid import Axis, Grid

# Shares and relative widths of the Gaussians: each has half the share and three times the width of the one before, so that the
# sum falls off slower than any Gaussian, as scattering does.
PARTS = ((4 / 7, 1.0), (2 / 7, 3.0), (1 / 7, 9.0))


def bloom(grid: Grid, width: float) -> Doubles:
    """Return a kernel of sum 1 over all pixels within reach; `width` is the narrowest standard deviation in pixels."""
    parts = [share * np.outer(_gaussian(grid.y, times * width), _gaussian(grid.x, times * width)) for share, times in PARTS]
    return grid.widened(np.sum(parts, axis=0))


def _gaussian(axis: Axis, width: float) -> Doubles:
    """Return the middle (2 near - 1,) of a Gaussian that sums to 1 over (2 reach - 1) pixels."""
    edges = np.arange(axis.near) + 0.5
    scale = axis.size / (width * math.sqrt(2.0))
    inside = np.array([math.erf(edge * scale) for edge in edges])  # integral from -edge to edge
    half = np.diff(inside) / 2
    whole: Doubles = np.concatenate([half[::-1], inside[:1], half])
    return whole / math.erf((axis.reach - 0.5) * scale)
