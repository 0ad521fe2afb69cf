"""Where a picture's pixels lie: in the frame that the camera's window covers, in part, or beyond it (overscan)."""

from __future__ import annotations

import math
from dataclasses import dataclass

Window = tuple[float, float, float, float]


@dataclass(frozen=True)
class PixelWindow:
    """Pixels from (x, y) on, counted right and down from the frame's upper left corner."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class Frame:
    resolution: tuple[int, int]  # width and height of the whole: an EXR's display window
    pixels: PixelWindow  # those that are rendered: its data window
    pixel_aspect_ratio: float = 1.0  # width over height of a pixel

    @property
    def size(self) -> tuple[int, int]:
        return self.pixels.width, self.pixels.height

    @property
    def is_whole(self) -> bool:
        return self.pixels == PixelWindow(0, 0, *self.resolution)


def whole_frame(width: int, height: int, pixel_aspect_ratio: float = 1.0) -> Frame:
    return Frame((width, height), PixelWindow(0, 0, width, height), pixel_aspect_ratio)


def pixels_within(window: Window, resolution: tuple[int, int]) -> PixelWindow:
    """Pixels whose centre is within (left, bottom, right, top), where (0, 0) is the frame's lower left corner, (1, 1) its upper
    right (UsdRenderSettingsBase, dataWindowNDC).

    A centre on the left or upper edge is within, one on the right or lower edge is not: windows side by side share no pixel
    (the rasterizers' rule that the text refers to). May be empty.
    """
    left, bottom, right, top = window
    width, height = resolution
    x0, x1 = _first_centre(left, width), _first_centre(right, width)
    y0, y1 = _first_centre(1.0 - top, height), _first_centre(1.0 - bottom, height)
    return PixelWindow(x0, y0, max(x1 - x0, 0), max(y1 - y0, 0))


def _first_centre(edge: float, count: int) -> int:
    """The first pixel whose centre is not before `edge`; within the rounding of the edge, which is a float, on it."""
    at = edge * count - 0.5
    nearest = round(at)
    return nearest if abs(at - nearest) <= max(abs(edge), 1.0) * count * 2.0**-23 else math.ceil(at)
