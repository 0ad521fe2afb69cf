"""Defaults and limits of settings, and the refusal of requests beyond them."""

from __future__ import annotations

import math

from ..errors import LimitError, SettingsError

# Longest edge of diced subdivision surfaces, in pixels.
DEFAULT_DICING_RATE = 4.0
# Largest error of motion paths between time samples, in pixels.
DEFAULT_MOTION_ERROR = 0.02

# Requests beyond these limits are taken for mistakes or attacks.
MAX_RESOLUTION = 2**17  # per side: beyond, floats resolve less than 1 / 128 of a pixel
MAX_PIXELS = 2**28
MAX_SPP = 2**24
DEFAULT_SPP = 64
QUICK_LOOK = 4  # samples; renders of fewer skip the pilot
# Samples per pixel in a block, one for each replicate. Ranges of samples begin and end between blocks.
SAMPLE_BLOCK = 2
MAX_THREADS = 1024
MAX_STOPS = 100.0  # of exposure, up or down: beyond, floats overflow


def limit_pixels(width: int, height: int, where: str = "") -> None:
    """Raise LimitError if an image of this size is too large; `where`: the setting that requests it."""
    fits = max(width, height) <= MAX_RESOLUTION and width * height <= MAX_PIXELS
    limit(fits, f"{width} x {height} pixels are too many: at most {MAX_RESOLUTION} a side and {MAX_PIXELS} in all", where)


def check_stops(stops: float | str, where: str) -> float:
    """Return the exposure in stops; SettingsError if it is not a number within the limits."""
    try:
        number = float(stops)
    except (TypeError, ValueError):
        number = math.nan
    if not abs(number) <= MAX_STOPS:
        sentence = f"the exposure must be a number of stops from -{MAX_STOPS:g} to {MAX_STOPS:g}, or auto, not {stops}"
        raise SettingsError(sentence, where=where)
    return number


def require(holds: bool, sentence: str, name: str) -> None:
    if not holds:
        raise SettingsError(sentence, where=name)


def limit(holds: bool, sentence: str, where: str = "") -> None:
    if not holds:
        raise LimitError(sentence, where=where)
