"""Spectra of illuminants, and spectra as the CIE 1931 standard observer (2 degrees) sees them.

A spectrum is a piecewise linear function given by pairs (nm, radiance), zero outside of the first and the last. The observer
is tabulated from 380 to 780 nm in steps of 5 nm, and linear in between: integrals are exact sums, however narrow a line is.
Illuminants are black bodies, daylight, and the daylight of a colour space's white.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from .color_space import Chromaticity, ColorSpace, xyz_from_rgb

LUMENS_PER_WATT = 683.0  # at 555 nm: the SI's K_cd, BIPM 2019, 2.3.1
WAVELENGTHS_NM = np.arange(380.0, 781.0, 5.0)

# x, y, z at 380, 385, ... 780 nm: CIE 15:2004, table T.4, six decimals.
# fmt: off
_XYZ_BAR = np.array([
    [0.001368, 0.002236, 0.004243, 0.00765, 0.01431, 0.02319, 0.04351, 0.07763, 0.13438, 0.21477, 0.2839, 0.3285,
     0.34828, 0.34806, 0.3362, 0.3187, 0.2908, 0.2511, 0.19536, 0.1421, 0.09564, 0.05795, 0.03201, 0.0147, 0.0049,
     0.0024, 0.0093, 0.0291, 0.06327, 0.1096, 0.1655, 0.22575, 0.2904, 0.3597, 0.43345, 0.51205, 0.5945, 0.6784,
     0.7621, 0.8425, 0.9163, 0.9786, 1.0263, 1.0567, 1.0622, 1.0456, 1.0026, 0.9384, 0.85445, 0.7514, 0.6424,
     0.5419, 0.4479, 0.3608, 0.2835, 0.2187, 0.1649, 0.1212, 0.0874, 0.0636, 0.04677, 0.0329, 0.0227, 0.01584,
     0.011359, 0.008111, 0.00579, 0.004109, 0.002899, 0.002049, 0.00144, 0.001, 0.00069, 0.000476, 0.000332,
     0.000235, 0.000166, 0.000117, 0.000083, 0.000059, 0.000042],
    [0.000039, 0.000064, 0.00012, 0.000217, 0.000396, 0.00064, 0.00121, 0.00218, 0.004, 0.0073, 0.0116, 0.01684,
     0.023, 0.0298, 0.038, 0.048, 0.06, 0.0739, 0.09098, 0.1126, 0.13902, 0.1693, 0.20802, 0.2586, 0.323, 0.4073,
     0.503, 0.6082, 0.71, 0.7932, 0.862, 0.91485, 0.954, 0.9803, 0.99495, 1, 0.995, 0.9786, 0.952, 0.9154, 0.87,
     0.8163, 0.757, 0.6949, 0.631, 0.5668, 0.503, 0.4412, 0.381, 0.321, 0.265, 0.217, 0.175, 0.1382, 0.107, 0.0816,
     0.061, 0.04458, 0.032, 0.0232, 0.017, 0.01192, 0.00821, 0.005723, 0.004102, 0.002929, 0.002091, 0.001484,
     0.001047, 0.00074, 0.00052, 0.000361, 0.000249, 0.000172, 0.00012, 0.000085, 0.00006, 0.000042, 0.00003,
     0.000021, 0.000015],
    [0.00645, 0.01055, 0.02005, 0.03621, 0.06785, 0.1102, 0.2074, 0.3713, 0.6456, 1.03905, 1.3856, 1.62296, 1.74706,
     1.7826, 1.77211, 1.7441, 1.6692, 1.5281, 1.28764, 1.0419, 0.81295, 0.6162, 0.46518, 0.3533, 0.272, 0.2123,
     0.1582, 0.1117, 0.07825, 0.05725, 0.04216, 0.02984, 0.0203, 0.0134, 0.00875, 0.00575, 0.0039, 0.00275, 0.0021,
     0.0018, 0.00165, 0.0014, 0.0011, 0.001, 0.0008, 0.0006, 0.00034, 0.00024, 0.00019, 0.0001, 0.00005, 0.00003,
     0.00002, 0.00001, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
])
# fmt: on


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Relative spectral radiance, non-negative; `wavelengths_nm` ascend."""

    wavelengths_nm: Doubles  # (N,)
    radiance: Doubles  # (N,)

    def at(self, nm: npt.ArrayLike) -> Doubles:
        values: Doubles = np.interp(np.asarray(nm, np.float64), self.wavelengths_nm, self.radiance, left=0.0, right=0.0)
        return values


def xyz(spectrum: Spectrum) -> Doubles:
    """Return (3,) integrals over the observer's curves, in the spectrum's unit times nm."""
    nm = _knots(spectrum)
    bars = np.stack([np.interp(nm, WAVELENGTHS_NM, bar, left=0.0, right=0.0) for bar in _XYZ_BAR])
    return _integrals(nm, bars, spectrum)


def watts(spectrum: Spectrum) -> float:
    """Return the integral over the whole domain, including the invisible part."""
    return float(np.trapezoid(spectrum.radiance, spectrum.wavelengths_nm))


def efficacy(spectrum: Spectrum) -> float:
    """Return the luminous efficacy in lumens per watt; 0 without power."""
    total = watts(spectrum)
    return LUMENS_PER_WATT * float(xyz(spectrum)[1]) / total if total > 0 else 0.0


def _knots(spectrum: Spectrum) -> Doubles:
    """Return the wavelengths where the spectrum or the observer has a knot, within both."""
    first, last = max(spectrum.wavelengths_nm[0], 380.0), min(spectrum.wavelengths_nm[-1], 780.0)
    if last < first:
        return np.zeros(2)
    inner = np.concatenate([spectrum.wavelengths_nm, WAVELENGTHS_NM])
    return np.unique(np.concatenate([[first, last], inner[(inner > first) & (inner < last)]]))


def _integrals(nm: Doubles, bars: Doubles, spectrum: Spectrum) -> Doubles:
    """Return integrals of products of piecewise linear functions by Simpson's rule, which is exact for them."""
    values, steps = spectrum.at(nm), np.diff(nm)
    ends = bars * values
    middles = (bars[:, 1:] + bars[:, :-1]) / 2 * ((values[1:] + values[:-1]) / 2)
    total: Doubles = ((ends[:, 1:] + ends[:, :-1] + 4 * middles) * steps / 6).sum(axis=1)
    return total


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
