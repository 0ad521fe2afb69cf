"""Data for showing a scene-linear picture at any exposure in a browser: 12-bit logarithms, and the view as a 3D table.

Exposure is an addition to logarithms; the view is a lookup cube, which the browser interpolates.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ..exposure import View

Bytes = npt.NDArray[np.uint8]

MOST_PIXELS = 640 * 360  # larger pictures are averaged down, to keep pages with many pictures small
DARKEST = -12.0  # logarithm of base 2
LEVELS = 4095
CUBE = 33  # points per side
CUBE_STOPS = (DARKEST, 12.0)


def reduced(values: Floats) -> Floats:
    """Return (H, W, C) averaged over square blocks to at most MOST_PIXELS pixels."""
    height, width = values.shape[:2]
    block = 1
    while (height // block) * (width // block) > MOST_PIXELS:
        block += 1
    if block == 1:
        return values
    rows, columns = height // block, width // block
    cut = values[: rows * block, : columns * block]
    means: Floats = cut.reshape(rows, block, columns, block, -1).mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
    return means


def logarithms(rgb: Floats) -> tuple[Bytes, float]:
    """Return (2 H, W, 3) logarithms and the value of the highest level.

    The upper half has the high 8 of 12 bits, the lower half the low 4; level 0 is black.
    """
    finite = np.where(np.isfinite(rgb), rgb, np.float32(0))
    brightest = max(float(np.log2(max(float(finite.max(initial=0.0)), 1e-30))), 0.0) + 1e-6
    stops = np.log2(np.maximum(finite, np.float32(2.0**DARKEST)))
    level = np.rint((stops - DARKEST) / (brightest - DARKEST) * LEVELS).astype(np.uint16)
    return np.concatenate([level >> 4, (level & 15) << 4]).astype(np.uint8), brightest


@lru_cache(maxsize=8)
def view_cube(view: View) -> Bytes:
    """Return the view as display values (CUBE, CUBE * CUBE, 3).

    Red runs from left to right in a square, green from square to square, blue downwards.
    """
    axis: Doubles = np.exp2(np.linspace(*CUBE_STOPS, CUBE))
    axis[0] = 0.0
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    grid = np.stack([red, green, blue], axis=-1).reshape(CUBE, CUBE * CUBE, 3).astype(np.float32)
    return np.rint(np.clip(view.shown(grid), 0, 1) * 255).astype(np.uint8)
