"""What is taken where nothing is asked for, what may be asked for at most, and how a request beyond that is refused."""

from __future__ import annotations

import math

from ..errors import LimitError, SettingsError

# Pixels that an edge of a diced subdivision surface may cover.
DEFAULT_DICING_RATE = 4.0
# Pixels by which what moves may be off, between the times at which its place is known.
DEFAULT_MOTION_ERROR = 0.02

# Beyond these a request is a mistake or an attack, not a picture.
MAX_RESOLUTION = 2**17  # a side: in floats a pixel beyond is known to less than its 128th part
MAX_PIXELS = 2**28
MAX_SPP = 2**24
DEFAULT_SPP = 64
QUICK_LOOK = 4  # samples; renders of fewer start at once
# Samples a pixel that stand together: each replicate takes one of them. Ranges of samples begin and end between blocks.
SAMPLE_BLOCK = 2
MAX_THREADS = 1024
MAX_STOPS = 100.0  # of an exposure, each way: beyond, floats overflow


def limit_pixels(width: int, height: int, where: str = "") -> None:
    """LimitError if an image of this size is too large; `where`: who asks for it."""
    fits = max(width, height) <= MAX_RESOLUTION and width * height <= MAX_PIXELS
    limit(fits, f"{width} x {height} pixels: {MAX_RESOLUTION} a side and {MAX_PIXELS} in all are allowed", where)


def check_stops(stops: float | str, where: str) -> float:
    """Return the exposure, a number of stops; SettingsError where no picture could be brightened so."""
    try:
        number = float(stops)
    except (TypeError, ValueError):
        number = math.nan
    if not abs(number) <= MAX_STOPS:
        sentence = f"the exposure is a number of stops from -{MAX_STOPS:g} to {MAX_STOPS:g}, or auto, not {stops}"
        raise SettingsError(sentence, where=where)
    return number


def require(holds: bool, sentence: str, name: str) -> None:
    if not holds:
        raise SettingsError(sentence, where=name)


def limit(holds: bool, sentence: str, where: str = "") -> None:
    if not holds:
        raise LimitError(sentence, where=where)
