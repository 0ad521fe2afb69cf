"""Spectra as the CIE's observer sees them, against published chromaticities and efficacies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from primray.color.color_space import ACESCG, LUMINANCE_WEIGHTS, REC709, luminance_weights, xyz_from_rgb
from primray.color.spectrum import (
    LUMENS_PER_WATT,
    Spectrum,
    black_body,
    daylight,
    efficacy,
    of_chromaticity,
    rgb_of,
    watts,
    xyz,
)

# CIE standard illuminant D65 at 380, 390, ... 780 nm: CIE 15:2004, table T.1.
D65 = [
    49.9755, 54.6482, 82.7549, 91.486, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923, 108.811, 109.354, 107.802,
    104.79, 107.689, 104.405, 104.046, 100.0, 96.3342, 95.788, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268,
    80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.349, 61.604, 69.8856, 75.087, 63.5927, 46.4182, 66.8054, 63.3828,
]  # fmt: skip
STEPS = np.arange(380.0, 781.0, 10.0)


def chromaticity(spectrum: Spectrum) -> tuple[float, float]:
    x, y, z = xyz(spectrum).tolist()
    return x / (x + y + z), y / (x + y + z)


def test_d65_is_white() -> None:
    published = Spectrum(STEPS, np.array(D65))
    assert chromaticity(published) == pytest.approx((0.31272, 0.32903), abs=5e-5)  # CIE 15:2004, table T.3
    assert rgb_of(published, REC709) == pytest.approx([1, 1, 1], abs=1e-3)
    assert rgb_of(published, ACESCG) == pytest.approx([1, 1, 1], abs=1e-3)
    assert daylight(6504).at(STEPS) == pytest.approx(D65, rel=5e-4)


@pytest.mark.parametrize(
    ("kelvin", "expected"), [(5003, (0.34567, 0.35850)), (5503, (0.33242, 0.34743)), (7504, (0.29902, 0.31485))]
)
def test_other_daylights(kelvin: float, expected: tuple[float, float]) -> None:
    """CIE 15:2004, table T.3: D50, D55, D75."""
    assert chromaticity(daylight(kelvin)) == pytest.approx(expected, abs=2e-4)


def test_black_bodies() -> None:
    """Illuminant A is one of 2856 K (c2 = 1.4388e-2): x = 0.44757, y = 0.40745."""
    assert chromaticity(black_body(2855.5)) == pytest.approx((0.44757, 0.40745), abs=1e-4)
    assert chromaticity(black_body(6500)) == pytest.approx((0.3135, 0.3237), abs=1e-4)
    assert black_body(3000).at(560) == pytest.approx(1)
    for kelvin in (100.0, 1e9):
        assert np.isfinite(black_body(kelvin).radiance).all()


def test_whites_have_a_daylight_of_their_own() -> None:
    for white in ((0.3127, 0.3290), (1 / 3, 1 / 3), (0.32168, 0.33767)):
        assert chromaticity(of_chromaticity(white)) == pytest.approx(white, abs=1e-4)


def test_narrow_lines_are_met_wherever_they_are() -> None:
    line = Spectrum(np.array([552.9, 553.0, 553.1]), np.array([0.0, 10.0, 0.0]))
    assert watts(line) == pytest.approx(1)
    assert efficacy(line) == pytest.approx(LUMENS_PER_WATT * (0.99495 + 0.6 * 0.00505), rel=1e-4)
    green = Spectrum(np.array([554.999, 555.0, 555.001]), np.array([0.0, 1000.0, 0.0]))
    assert efficacy(green) == pytest.approx(683, rel=1e-4)


def test_what_nobody_sees_has_power_and_no_colour() -> None:
    infrared = Spectrum(np.array([900.0, 1000.0]), np.array([1.0, 1.0]))
    assert (watts(infrared), efficacy(infrared)) == (100.0, 0.0)
    assert rgb_of(infrared, REC709) is None
    half = Spectrum(np.array([380.0, 780.0, 780.001, 1180.0]), np.array([1.0, 1.0, 1.0, 1.0]))
    even = Spectrum(np.array([380.0, 780.0]), np.array([1.0, 1.0]))
    assert efficacy(half) == pytest.approx(efficacy(even) / 2, rel=1e-5)
    assert chromaticity(even) == pytest.approx((1 / 3, 1 / 3), abs=1e-4)


def test_luminance_is_y() -> None:
    assert luminance_weights(REC709) == LUMINANCE_WEIGHTS
    assert math.fsum(luminance_weights(ACESCG)) == pytest.approx(1)
    assert luminance_weights(ACESCG) == pytest.approx(xyz_from_rgb(ACESCG.gamut)[1])
    rgb = rgb_of(black_body(3000), ACESCG)
    assert rgb is not None
    assert rgb @ np.array(luminance_weights(ACESCG)) == pytest.approx(1)
