"""The bloom about what is bright: Gaussians of growing width, integrated over pixels."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Doubles
from .grid import Axis, Grid

# Shares and widths of the parts: each broader one holds half as much, three times as far, so that the whole falls off slower
# than any Gaussian, as scattering does.
PARTS = ((4 / 7, 1.0), (2 / 7, 3.0), (1 / 7, 9.0))


def bloom(grid: Grid, width: float) -> Doubles:
    """A kernel of sum 1 over all that light comes to; `width`: the narrowest standard deviation in pixels."""
    parts = [share * np.outer(_gaussian(grid.y, times * width), _gaussian(grid.x, times * width)) for share, times in PARTS]
    return grid.widened(np.sum(parts, axis=0))


def _gaussian(axis: Axis, width: float) -> Doubles:
    """(2 near - 1,) of the (2 reach - 1) pixels, which sum to 1."""
    edges = np.arange(axis.near) + 0.5
    scale = axis.size / (width * math.sqrt(2.0))
    inside = np.array([math.erf(edge * scale) for edge in edges])  # of the whole, between -edge and edge
    half = np.diff(inside) / 2
    whole: Doubles = np.concatenate([half[::-1], inside[:1], half])
    return whole / math.erf((axis.reach - 0.5) * scale)
