"""Times to an error and powers of growth are read off rightly."""

from __future__ import annotations

import numpy as np
import pytest

from .fits import growth, power_of_n_log_n, time_to


def test_between_points_logarithms_are_interpolated():
    found = time_to([(1.0, 0.1), (4.0, 0.01), (16.0, 0.001)], 0.0316227766)
    assert found is not None
    assert not found.extrapolated
    assert found.seconds == pytest.approx(2.0)


@pytest.mark.parametrize(("error", "seconds"), [(0.2, 0.5), (0.0005, 32.0)])
def test_beyond_the_points_error_times_seconds_is_kept(error, seconds):
    found = time_to([(1.0, 0.1), (16.0, 0.001)], error)
    assert found is not None
    assert found.extrapolated
    assert found.seconds == pytest.approx(seconds)


def test_pictures_as_good_as_the_reference_do_not_count():
    assert time_to([(1.0, -1e-6)], 0.1) is None
    found = time_to([(1.0, 0.1), (2.0, -1e-9)], 0.05)
    assert found is not None
    assert found.extrapolated


@pytest.mark.parametrize("power", [0.5, 1.0, 1.3, 2.0])
@pytest.mark.parametrize("fixed", [0.0, 0.4])
def test_the_power_is_found_beside_a_fixed_part(power, fixed):
    counts = np.array([1e3, 1e4, 1e5, 1e6, 1e7])
    found = growth(list(counts), list(fixed + 3e-6 * counts**power))
    assert found.power == pytest.approx(power, abs=0.011)
    assert found.residual < 0.01
    assert found.at(1e7) == pytest.approx(fixed + 3e-6 * 1e7**power, rel=0.03)


def test_noise_of_ten_percent_leaves_the_power_nearly_where_it_is():
    counts = np.array([1e3, 1e4, 1e5, 1e6, 1e7])
    noise = 1 + 0.1 * np.random.default_rng(1).uniform(-1, 1, (15, 5))
    powers = [growth(list(counts), list((0.1 + 1e-6 * counts) * each)).power for each in noise]
    assert np.median(powers) == pytest.approx(1.0, abs=0.03)


def test_what_does_not_grow_has_no_power():
    found = growth([1, 10, 100, 1000], [0.3] * 4)
    assert found.at(1000) == pytest.approx(0.3)


def test_n_log_n_looks_like_a_power_a_little_above_one():
    counts = np.array([1e3, 1e4, 1e5, 1e6, 1e7])
    assert growth(list(counts), list(counts * np.log(counts))).power == pytest.approx(power_of_n_log_n([1e3, 1e7]), abs=0.03)


def test_too_little_to_fit_is_refused():
    with pytest.raises(ValueError, match="four"):
        growth([1, 2, 3], [1.0, 2.0, 4.0])
