"""Data of an interactive picture: logarithms in bytes, reduced pictures, relative errors as colours."""

from __future__ import annotations

import numpy as np
import pytest

from primray.images.showing import DARKEST, LEAST, LEVELS, RAMP, heat, logarithms, reduced, relative_errors


def test_logarithms_come_back() -> None:
    values = np.exp2(np.linspace(-11, 9, 64, dtype=np.float32)).reshape(8, 8, 1).repeat(3, axis=2)
    levels, brightest = logarithms(values)
    level = (levels[:8].astype(int) << 4) | (levels[8:] >> 4)
    back = np.exp2(DARKEST + level / LEVELS * (brightest - DARKEST))
    assert np.abs(back / values - 1).max() < 0.002
    assert logarithms(np.zeros((1, 1, 3), np.float32))[0].max() == 0


def test_large_pictures_are_means() -> None:
    values = np.arange(1000 * 800, dtype=np.float32).reshape(800, 1000, 1)
    small = reduced(values)
    assert small.shape == (400, 500, 1)
    assert small[0, 0, 0] == values[:2, :2].mean()


def test_errors_are_relative_and_their_squares_averaged() -> None:
    pixels, errors = np.ones((5, 5, 4), np.float32), np.zeros((5, 5, 3), np.float32)
    errors[2, 2] = 0.3
    found = relative_errors(pixels, errors)
    assert found is not None
    assert found[1, 1] == pytest.approx(0.3 / 3 / np.sqrt(1.01))
    assert found[0, 4] == 0
    assert relative_errors(pixels, np.full((5, 5, 3), np.inf, np.float32)) is None
    assert heat(np.array([[0.0, LEAST], [1.0, 10.0]])).tolist() == [[RAMP[0].tolist()] * 2, [RAMP[-1].tolist()] * 2]
