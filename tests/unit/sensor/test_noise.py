"""Random draws: their moments and distributions, and bits that do not change."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from primray.sensor.noise import Draws, _log_factorial


def test_bits_are_those_of_philox() -> None:
    found = Draws(7, 3).uniform(1, 0, 3)
    again = np.random.Philox(key=[7, 0x7072696D726179], counter=[0, 1, 0, 3]).random_raw(3)
    assert np.array_equal(found, (again >> np.uint64(11)) * 2.0**-53 + 2.0**-54)
    assert not np.array_equal(found, Draws(7, 4).uniform(1, 0, 3))
    assert not np.array_equal(found, Draws(8, 3).uniform(1, 0, 3))


@pytest.mark.parametrize("mean", [0.0, 0.02, 1.0, 7.5, 29.9, 30.1, 200.0, 25000.0])
def test_poisson_deviates_have_their_mean_variance_and_distribution(mean: float) -> None:
    count = 200_000
    found = Draws(1).poisson(np.full((400, count // 400), mean)).ravel()
    assert (found >= 0).all()
    assert (found == np.rint(found)).all()
    if mean == 0:
        assert not found.any()
        return
    assert found.mean() == pytest.approx(mean, abs=4.5 * math.sqrt(mean / count))
    spread = math.sqrt((2 + 1 / mean) / count)  # relative standard error of a Poisson variance
    assert found.var() == pytest.approx(mean, rel=4.5 * spread)
    k = np.arange(max(0, int(mean - 6 * math.sqrt(mean))), int(mean + 6 * math.sqrt(mean)) + 8)
    chance = np.exp(k * math.log(mean) - mean - np.array([math.lgamma(n + 1) for n in k.tolist()]))
    seen = np.array([(found == n).sum() for n in k.tolist()]) if len(k) < 100 else None
    if seen is None:  # in 40 bins
        edges = np.linspace(k[0], k[-1] + 1, 41).astype(int)
        seen = np.histogram(found, edges)[0]
        chance = np.array([chance[(k >= a) & (k < b)].sum() for a, b in pairwise(edges)])
    enough = chance * count > 8
    chi = ((seen[enough] - chance[enough] * count) ** 2 / (chance[enough] * count)).sum()
    degrees = int(enough.sum())
    assert chi < degrees + 5 * math.sqrt(2 * degrees)


def test_a_pixels_draw_does_not_depend_on_its_neighbours() -> None:
    mean = np.full(1000, 50.0)
    other = mean.copy()
    other[500] = 3.0
    a, b = Draws(2).poisson(mean), Draws(2).poisson(other)
    assert np.array_equal(np.delete(a, 500), np.delete(b, 500))


def test_normal_deviates() -> None:
    found = Draws(5).normal(400_000)
    assert found.mean() == pytest.approx(0, abs=0.008)
    assert found.var() == pytest.approx(1, abs=0.011)
    assert (found**4).mean() == pytest.approx(3, abs=0.08)


def test_log_factorials() -> None:
    k = np.array([0, 1, 5, 63, 64, 65, 1000, 30000.0])
    assert np.allclose(_log_factorial(k), [math.lgamma(n + 1) for n in k], rtol=1e-12, atol=1e-12)
