"""Comparison of pictures without standard errors, tile by tile and by values only, since their noise is unknown.

Scene-linear pictures are compared by the RMS of their difference relative to the RMS of the pictures, display values (PNG,
JPEG, TIFF) by the RMS of the difference itself, with white at 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles
from .difference import Difference
from .difference_tests import Grid

LINEAR_NOTE = "neither picture has standard errors: differences are judged by their size alone, noise among them"
DISPLAY_NOTE = "both have display values, without standard errors: differences are judged by their size, noise among them"


@dataclass(frozen=True, eq=False)
class Apart:
    """Differences of regions of two pictures, (h, w) each."""

    size: Doubles  # root mean square of the difference over all channels
    signed: Doubles  # mean difference over R, G, B: B - A


def apart(of: Difference, grid: Grid, display: bool) -> Apart:
    """Compute the differences of a grid's regions, relative to the picture unless the values are display values."""
    pixels = np.maximum(grid.sum(of.judged.astype(np.float64)), 1.0)
    square = grid.sum((of.d**2).mean(axis=0)) / pixels
    signed = grid.sum(of.d[:3].mean(axis=0)) / pixels
    if display:
        return Apart(np.sqrt(square), signed)
    power = grid.sum((of.mean**2).mean(axis=0)) / pixels + of.floor**2
    scale = np.sqrt(np.where(power > 0, power, 1.0))
    return Apart(np.sqrt(square) / scale, signed / scale)
