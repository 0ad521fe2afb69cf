"""Validated reading of a frame from a checkpoint's JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..description import Frame, PixelWindow
from ..settings import MAX_RESOLUTION


def frame_of(values: Mapping[str, Any]) -> Frame:
    """Return the frame; ValueError, KeyError or TypeError if the JSON is not valid."""
    width, height = values["resolution"]
    window = [values["pixels"][name] for name in ("x", "y", "width", "height")]
    aspect = float(values["pixel_aspect_ratio"])
    _valid(all(type(n) is int and 0 < n <= MAX_RESOLUTION for n in (width, height, *window[2:])))
    _valid(all(type(n) is int and abs(n) <= MAX_RESOLUTION for n in window[:2]) and 0 < aspect < math.inf)
    return Frame((width, height), PixelWindow(*window), aspect)


def _valid(holds: bool) -> None:
    if not holds:
        raise ValueError
