"""Starburst: light diffracted by the aperture, a streak perpendicular to each edge of the polygon of its blades.

The far-field pattern is the squared magnitude of the aperture's Fourier transform (Fraunhofer; Goodman, "Introduction to
Fourier Optics", 4.3) and scales with the wavelength, as in Ritschel et al. 2009, "Temporal glare".
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from .grid import Axis, Grid

# Samples per side of the transform, and the aperture's diameter in samples: the pattern has steps of a quarter of wavelength
# over diameter, and extends to 128 wavelengths over diameter.
SAMPLES, DIAMETER = 1024, 256
STEP = DIAMETER / SAMPLES
GREEN_NM = 550.0
# Dominant wavelengths of Rec.709's red, green and blue under D65, and offsets of a band around each, wide enough to blur
# rings together: no channel sees a single wavelength.
CHANNELS_NM = (611.4, 549.1, 464.2)
BAND = tuple(np.linspace(-36.0, 36.0, 9))


def starburst(grid: Grid, width: float, blades: int, rotation_deg: float) -> tuple[Doubles, Doubles, Doubles]:
    """Return kernels of sum 1 for red, green and blue; `width`: green's wavelength over the aperture's diameter, in pixels."""
    pattern = _pattern(blades, rotation_deg)
    red, green, blue = (_of_channel(pattern, grid, width, middle) for middle in CHANNELS_NM)
    return red, green, blue


def _of_channel(pattern: Doubles, grid: Grid, width: float, middle_nm: float) -> Doubles:
    steps = [STEP * width * (middle_nm + offset) / GREEN_NM for offset in BAND]  # in pixels' heights
    ends_y, ends_x = (min(axis.near, math.ceil(SAMPLES / 2 * max(steps) / axis.size) + 2) for axis in (grid.y, grid.x))
    found = np.zeros((2 * ends_y - 1, 2 * ends_x - 1))
    for step in steps:
        rows, all_rows = _shares(grid.y, ends_y, step)
        columns, all_columns = _shares(grid.x, ends_x, step)
        found += rows @ pattern @ columns.T / (all_rows @ pattern @ all_columns)
    return grid.widened(found / len(steps))


def _shares(axis: Axis, near: int, step: float) -> tuple[Doubles, Doubles]:
    """Return each sample's share in each pixel nearer than `near`, (2 near - 1, SAMPLES), and in all pixels within reach,
    (SAMPLES,)."""
    edges = (np.arange(SAMPLES + 1) - SAMPLES / 2 - 0.5) * (step / axis.size)  # in pixels

    def below(position: npt.NDArray[Any]) -> Doubles:
        share: Doubles = np.clip((position[:, None] - edges[None, :-1]) / (edges[1] - edges[0]), 0.0, 1.0)
        return share

    borders = np.arange(2.0 * near) - (near - 0.5)
    ends = np.array([0.5 - axis.reach, axis.reach - 0.5])
    return np.diff(below(borders), axis=0), np.diff(below(ends), axis=0)[0]


@lru_cache(maxsize=4)
def _pattern(blades: int, rotation_deg: float) -> Doubles:
    """Return the pattern (SAMPLES, SAMPLES) of sum 1, centred at SAMPLES / 2, rows downwards; it is point-symmetric."""
    found: Doubles = np.abs(np.fft.fftshift(np.fft.fft2(_aperture(blades, rotation_deg)))) ** 2
    found /= found.sum()
    found.flags.writeable = False
    return found


def _aperture(blades: int, rotation_deg: float) -> Doubles:
    """Return the open share of each cell of the aperture (antialiased edges)."""
    right = np.arange(SAMPLES) - SAMPLES / 2 + 0.5
    y, x = -right[:, None], right[None, :]
    radius = DIAMETER / 2
    if not blades:
        inside = radius - np.hypot(y, x)
    else:
        inside = np.full((SAMPLES, SAMPLES), np.inf)
        apothem = radius * math.cos(math.pi / blades)
        for blade in range(blades):  # an edge's normal lies between two corners
            angle = math.radians(rotation_deg) + (2 * blade + 1) * math.pi / blades
            inside = np.minimum(inside, apothem - (x * math.cos(angle) + y * math.sin(angle)))
    open_share: Doubles = np.clip(inside + 0.5, 0.0, 1.0)
    return open_share
