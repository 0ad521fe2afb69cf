"""Shutter, and size of objects in pixels, as known before skeletons pose the stage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ..motion.pixels import Pixels
from ..motion.timing import AT_FRAME, Timing


@dataclass(frozen=True, eq=False)
class Foreseen:
    """Timing and error bound of the render, and the camera's pixels if it is known."""

    timing: Timing = AT_FRAME
    most: float = 1.0  # largest motion error in pixels
    pixels: Pixels | None = None  # None: the camera is made once the scene is translated
    side: int = 1  # longer side of the image, in pixels

    def per_length(self, low: Doubles, high: Doubles, is_placed: bool = True) -> Doubles:
        """Return pixels per unit of length (K,) within the boxes (K, 3); without a known camera or placement, as if each box
        filled the image."""
        if self.pixels is not None and is_placed:
            return self.pixels.per_length(low, high)
        size = np.linalg.norm(high - low, axis=1)
        return np.asarray(self.side / np.where(size > 0.0, size, 1.0))


UNSEEN = Foreseen()
