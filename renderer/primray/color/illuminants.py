"""Spectra of illuminants: black bodies, daylight, and the daylight of a colour space's white."""

from __future__ import annotations

import numpy as np

from ..arrays import Doubles
from .color_space import Chromaticity, ColorSpace, xyz_from_rgb
from .spectrum import WAVELENGTHS_NM, Spectrum, xyz

SECOND_RADIATION_NM_K = 1.438776877e7  # h c / k: CODATA 2018
DAYLIGHT_K = (4000.0, 25000.0)  # range of the CIE's definition

# S0, S1, S2 at 380, 390, ... 780 nm: CIE 15:2004, table T.2.
# fmt: off
_DAYLIGHT = np.array([
    [63.4, 65.8, 94.8, 104.8, 105.9, 96.8, 113.9, 125.6, 125.5, 121.3, 121.3, 113.5, 113.1, 110.8, 106.5, 108.8,
     105.3, 104.4, 100, 96, 95.1, 89.1, 90.5, 90.3, 88.4, 84, 85.1, 81.9, 82.6, 84.9, 81.3, 71.9, 74.3, 76.4, 63.3,
     71.7, 77, 65.2, 47.7, 68.6, 65],
    [38.5, 35, 43.4, 46.3, 43.9, 37.1, 36.7, 35.9, 32.6, 27.9, 24.3, 20.1, 16.2, 13.2, 8.6, 6.1, 4.2, 1.9, 0, -1.6,
     -3.5, -3.5, -5.8, -7.2, -8.6, -9.5, -10.9, -10.7, -12, -14, -13.6, -12, -13.3, -12.9, -10.6, -11.6, -12.2,
     -10.2, -7.8, -11.2, -10.4],
    [3, 1.2, -1.1, -0.5, -0.7, -1.2, -2.6, -2.9, -2.8, -2.6, -2.6, -1.8, -1.5, -1.3, -1.2, -1, -0.5, -0.3, 0, 0.2,
     0.5, 2.1, 3.2, 4.1, 4.7, 5.1, 6.7, 7.3, 8.6, 9.8, 10.2, 8.3, 9.6, 8.5, 7, 7.6, 8, 6.7, 5.2, 7.4, 6.8],
])
# fmt: on
_DAYLIGHT_NM = np.arange(380.0, 781.0, 10.0)


def black_body(kelvin: float) -> Spectrum:
    """Return Planck's law from 380 to 780 nm, 1 at 560 nm; `kelvin` is at least 100."""
    exponent = SECOND_RADIATION_NM_K / (WAVELENGTHS_NM * kelvin)
    at_560 = SECOND_RADIATION_NM_K / (560.0 * kelvin)
    # Combine exponents before exponentiation: those of cold bodies overflow.
    with np.errstate(over="ignore", under="ignore"):
        ratio = np.exp(at_560 - exponent) * np.expm1(-at_560) / np.expm1(-exponent)
    return Spectrum(WAVELENGTHS_NM, ratio * (560.0 / WAVELENGTHS_NM) ** 5)


def daylight(kelvin: float) -> Spectrum:
    """Return the CIE's illuminant D of a correlated colour temperature within DAYLIGHT_K (CIE 15:2004, 3.1: D65 is 6504 K)."""
    return of_chromaticity(daylight_chromaticity(kelvin))


def daylight_chromaticity(kelvin: float) -> Chromaticity:
    """Return the chromaticity of an illuminant D (CIE 15:2004, equations 3.2 to 3.4)."""
    t = 1e3 / kelvin
    if kelvin <= 7000:
        x = 0.244063 + t * (0.09911 + t * (2.9678 - 4.6070 * t))
    else:
        x = 0.237040 + t * (0.24748 + t * (1.9018 - 2.0064 * t))
    return x, -3.0 * x * x + 2.870 * x - 0.275


def of_chromaticity(white: Chromaticity) -> Spectrum:
    """Return the daylight of a chromaticity (CIE 15:2004, equations 3.5 and 3.6), clamped to 0."""
    x, y = white
    below = 0.0241 + 0.2562 * x - 0.7341 * y
    m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / below
    m2 = (0.0300 - 31.4424 * x + 30.0717 * y) / below
    s0, s1, s2 = _DAYLIGHT
    return Spectrum(_DAYLIGHT_NM, np.maximum(s0 + m1 * s1 + m2 * s2, 0.0))


def rgb_of(spectrum: Spectrum, space: ColorSpace) -> Doubles | None:
    """Return (3,) linear RGB of luminance 1, possibly negative where out of gamut; None for invisible spectra."""
    tristimulus = xyz(spectrum)
    if not tristimulus[1] > 0:
        return None
    rgb: Doubles = np.linalg.solve(xyz_from_rgb(space.gamut), tristimulus / tristimulus[1])
    return rgb
