"""Display and data windows of OpenEXR images: the picture, and the part of it, or beyond it, that is stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

# Only this format's windows describe the picture: offsets in a PNG or TIFF are positions on a page.
_FORMAT = "openexr"


@dataclass(frozen=True)
class Windows:
    """Position (`x`, `y`) of the stored pixels from the picture's upper left, and both sizes as (width, height)."""

    x: int
    y: int
    stored: tuple[int, int]
    picture: tuple[int, int]

    @property
    def differ(self) -> bool:
        return (self.x, self.y) != (0, 0) or self.stored != self.picture

    @property
    def covers(self) -> bool:
        """Whether all of the picture is stored."""
        sides = zip((self.x, self.y), self.stored, self.picture, strict=True)
        return all(begin <= 0 and begin + has >= whole for begin, has, whole in sides)

    def pictured(self, pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return (H, W, C) stored pixels as the picture's: overscan is cropped, missing pixels are 0."""
        (width, height), (has_width, has_height) = self.picture, self.stored
        made = np.zeros((height, width, pixels.shape[2]), pixels.dtype)
        left, right = max(self.x, 0), min(self.x + has_width, width)
        top, bottom = max(self.y, 0), min(self.y + has_height, height)
        if left < right and top < bottom:
            made[top:bottom, left:right] = pixels[top - self.y : bottom - self.y, left - self.x : right - self.x]
        return made


def windows_of(spec: Any, format_name: str) -> Windows:
    """Return the windows in a file's header, as read by OpenImageIO."""
    stored = spec.width, spec.height
    if format_name != _FORMAT or spec.full_width < 1 or spec.full_height < 1:
        return Windows(0, 0, stored, stored)
    return Windows(spec.x - spec.full_x, spec.y - spec.full_y, stored, (spec.full_width, spec.full_height))
