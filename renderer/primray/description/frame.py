"""Position of a picture's pixels relative to the frame that the camera's window covers: all of it, a part, or beyond it
(overscan)."""

from __future__ import annotations

import math
from dataclasses import dataclass

Window = tuple[float, float, float, float]


@dataclass(frozen=True)
class PixelWindow:
    """Rectangle of pixels whose first is (x, y), counted right and down from the frame's upper left corner."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class Frame:
    resolution: tuple[int, int]  # width and height of the whole frame: an EXR's display window
    pixels: PixelWindow  # rendered pixels: an EXR's data window
    pixel_aspect_ratio: float = 1.0  # width of a pixel over its height

    @property
    def size(self) -> tuple[int, int]:
        return self.pixels.width, self.pixels.height

    @property
    def is_whole(self) -> bool:
        return self.pixels == PixelWindow(0, 0, *self.resolution)


def whole_frame(width: int, height: int, pixel_aspect_ratio: float = 1.0) -> Frame:
    return Frame((width, height), PixelWindow(0, 0, width, height), pixel_aspect_ratio)


def pixels_within(window: Window, resolution: tuple[int, int]) -> PixelWindow:
    """Return the pixels whose centres are within (left, bottom, right, top), where (0, 0) is the frame's lower left corner and
    (1, 1) its upper right (UsdRenderSettingsBase, dataWindowNDC).

    A centre on the left or upper edge is inside, one on the right or lower edge is not, so adjacent windows share no pixel (the
    rasterizers' rule that the schema refers to). The result may be empty.
    """
    left, bottom, right, top = window
    width, height = resolution
    x0, x1 = _first_centre(left, width), _first_centre(right, width)
    y0, y1 = _first_centre(1.0 - top, height), _first_centre(1.0 - bottom, height)
    return PixelWindow(x0, y0, max(x1 - x0, 0), max(y1 - y0, 0))


def _first_centre(edge: float, count: int) -> int:
    """Return the first pixel whose centre is at or after `edge`, to within the rounding of the edge as a float."""
    at = edge * count - 0.5
    nearest = round(at)
    return nearest if abs(at - nearest) <= max(abs(edge), 1.0) * count * 2.0**-23 else math.ceil(at)
