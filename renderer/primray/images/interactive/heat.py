"""Per-pixel error as a colour: from a thousandth of the pixel's value to all of it, logarithmically."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats

LEAST, MOST = 1e-3, 1.0
# From black through blue, red and yellow to white: brighter is worse, also for colour-blind viewers.
RAMP = np.array([(0, 0, 10), (40, 20, 120), (180, 40, 90), (250, 150, 30), (255, 255, 230)], np.float64)


def relative_errors(pixels: Floats, errors: Floats) -> Doubles | None:
    """Return errors (H, W) weighted as in relMSE, with squares averaged over 3 x 3 pixels; None if no error is known."""
    known = np.asarray(np.isfinite(errors).all(axis=2))
    if not known.any():
        return None
    squares = np.where(known[..., None], errors, 0.0).astype(np.float64) ** 2
    weighed = (squares / (pixels[..., :3].astype(np.float64) ** 2 + 0.01)).mean(axis=2)
    padded = np.pad(weighed, 1, mode="edge")
    height, width = weighed.shape
    around = sum(padded[y : y + height, x : x + width] for y in range(3) for x in range(3))
    roots: Doubles = np.sqrt(np.asarray(around) / 9)
    return roots


def heat(errors: Doubles) -> npt.NDArray[np.uint8]:
    """Return colours (H, W, 3) of the ramp for errors (H, W)."""
    span = np.log(MOST / LEAST)
    place = np.log(np.maximum(errors, LEAST) / LEAST) / span * (len(RAMP) - 1)
    channels = [np.interp(place, np.arange(len(RAMP)), RAMP[:, channel]) for channel in range(3)]
    colors: npt.NDArray[np.uint8] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    return colors


def gradient() -> str:
    """Return the ramp as a CSS gradient, for the legend."""
    return "linear-gradient(to right, {})".format(", ".join("rgb({:.0f}, {:.0f}, {:.0f})".format(*color) for color in RAMP))
