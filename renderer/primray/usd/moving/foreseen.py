"""What is known of motion before skeletons pose anything: when the shutter is open, and how large the camera sees things."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from .pixels import Pixels
from .timing import AT_FRAME, Timing


@dataclass(frozen=True, eq=False)
class Foreseen:
    timing: Timing = AT_FRAME
    most: float = 1.0  # pixels that paths may be off
    pixels: Pixels | None = None  # None: the camera is only made when everything is known
    side: int = 1  # the picture's longer one, in pixels

    def per_length(self, low: Doubles, high: Doubles, is_placed: bool = True) -> Doubles:
        """(K,) pixels a unit of length of what is within the boxes (K, 3); where it is not known how near that comes, as if it
        filled the picture."""
        if self.pixels is not None and is_placed:
            return self.pixels.per_length(low, high)
        size = np.linalg.norm(high - low, axis=1)
        return np.asarray(self.side / np.where(size > 0.0, size, 1.0))


UNSEEN = Foreseen()
