"""What a browser needs to show a scene-linear picture at any exposure: its logarithms in 12 bits, and the view as a table.

Exposure is a sum in logarithms; what the view makes of them is looked up in a cube between whose points a browser interpolates.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ..exposure import View

Bytes = npt.NDArray[np.uint8]

MOST_PIXELS = 640 * 360  # finer pictures are averaged: a page of pictures should stay small
DARKEST = -12.0  # as logarithms of base 2
LEVELS = 4095
CUBE = 33  # points of a side
CUBE_STOPS = (DARKEST, 12.0)


def reduced(values: Floats) -> Floats:
    """(H, W, C) as means of square blocks, so that there are no more than MOST_PIXELS."""
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
    """(2 H, W, 3): the high 8 bits of 12, below them the low 4; and what the highest level stands for. Level 0 is black."""
    finite = np.where(np.isfinite(rgb), rgb, np.float32(0))
    brightest = max(float(np.log2(max(float(finite.max(initial=0.0)), 1e-30))), 0.0) + 1e-6
    stops = np.log2(np.maximum(finite, np.float32(2.0**DARKEST)))
    level = np.rint((stops - DARKEST) / (brightest - DARKEST) * LEVELS).astype(np.uint16)
    return np.concatenate([level >> 4, (level & 15) << 4]).astype(np.uint8), brightest


@lru_cache(maxsize=8)
def view_cube(view: View) -> Bytes:
    """(CUBE, CUBE * CUBE, 3) display values: red from left to right within a square, green from square to square, blue down."""
    axis: Doubles = np.exp2(np.linspace(*CUBE_STOPS, CUBE))
    axis[0] = 0.0
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    grid = np.stack([red, green, blue], axis=-1).reshape(CUBE, CUBE * CUBE, 3).astype(np.float32)
    return np.rint(np.clip(view.shown(grid), 0, 1) * 255).astype(np.uint8)
