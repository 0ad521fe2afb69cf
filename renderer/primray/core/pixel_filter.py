"""Pixel filters as tables of offsets, for the core's filter importance sampling."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..settings import Filter

CELLS = 512  # as PixelFilter::kCells in scene/camera.hpp


def profile(filter: Filter, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the filter's value at x in [-1, 1], its full width."""
    if filter is Filter.GAUSSIAN:
        # Standard deviation: a quarter of the width; shifted so that it is 0 at the ends, two standard deviations away.
        return np.asarray(np.exp(-2 * x * x) - np.exp(-2.0))
    if filter is Filter.BLACKMAN_HARRIS:
        # Harris 1978, "On the Use of Windows for Harmonic Analysis with the Discrete Fourier Transform", 4 terms, -92 dB.
        t = np.pi * (x + 1)
        return 0.35875 - 0.48829 * np.cos(t) + 0.14128 * np.cos(2 * t) - 0.01168 * np.cos(3 * t)
    return np.ones_like(x)


def inverse_cdf(filter: Filter, width: float) -> npt.NDArray[np.float32]:
    """Return offsets in pixels at cumulative probability i / CELLS, (CELLS + 2,); empty for a box, which needs no table."""
    if filter is Filter.BOX:
        return np.zeros(0, np.float32)
    x = np.linspace(-1, 1, 20001)
    f = profile(filter, x)
    cdf = np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / 2)])
    cdf /= cdf[-1]
    offsets = np.interp(np.arange(CELLS + 1) / CELLS, cdf, x) * (width / 2)
    return np.append(offsets, offsets[-1]).astype(np.float32)
