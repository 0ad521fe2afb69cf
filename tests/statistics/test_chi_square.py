"""The chi-square test itself: it accepts the right density and rejects wrong ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.statistics.chi_square import Doubles, SphereCells, SquareCells, density_p_value, survival

N = 100_000


def cosine_samples(seed: int = 0) -> Doubles:
    u, v = np.random.default_rng(seed).random((2, N))
    r = np.sqrt(u)
    return np.stack([r * np.cos(2 * np.pi * v), r * np.sin(2 * np.pi * v), np.sqrt(1 - u)], axis=1)


def cosine_density(w: Doubles) -> Doubles:
    return np.maximum(w[:, 2], 0) / np.pi


def test_survival_matches_tables() -> None:
    # Quantiles of chi-square: 95 % at 10, 99 % at 100 and 99.9 % at 1000 degrees of freedom.
    assert survival(18.307, 10) == pytest.approx(0.05, rel=0.01)
    assert survival(135.807, 100) == pytest.approx(0.01, rel=0.01)
    assert survival(1143.917, 1000) == pytest.approx(0.001, rel=0.01)


def test_right_density_is_accepted() -> None:
    for axis in ([0, 0, 1], [1, 2, -0.5]):
        assert density_p_value(SphereCells(axis), cosine_density, cosine_samples(), N) > 0.01


def test_p_values_are_spread_evenly() -> None:
    p = [density_p_value(SphereCells([0.3, 0, 1]), cosine_density, cosine_samples(seed), N) for seed in range(40)]
    # Kolmogorov and Smirnov's distance at significance 0.001 for 40 values: 1.95 / sqrt(40).
    ordered = np.sort(p)
    assert np.max(np.abs(ordered - (np.arange(40) + 0.5) / 40)) < 1.95 / math.sqrt(40)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda w: cosine_density(w) * 0.97,
        lambda w: cosine_density(w) * 1.03,
        lambda w: np.where(w[:, 2] > 0, 1 / (2 * np.pi), 0),
        lambda w: np.maximum(w @ [math.sin(0.03), 0, math.cos(0.03)], 0) / np.pi,
        lambda w: np.where(w[:, 2] > 0.99, 0.5, 1) * cosine_density(w),
    ],
    ids=["scaled down", "scaled up", "uniform", "skewed", "dented"],
)
def test_wrong_density_is_rejected(wrong: object) -> None:
    assert density_p_value(SphereCells([0, 0, 1]), wrong, cosine_samples(), N) < 1e-6  # type: ignore[arg-type]


def test_samples_where_nothing_is_expected_are_rejected() -> None:
    w = cosine_samples()
    w[:60, 2] *= -1
    assert density_p_value(SphereCells([0, 0, 1]), cosine_density, w, N) < 1e-6


def test_dropped_samples_are_a_cell() -> None:
    w = cosine_samples()
    kept = w[w[:, 2] > 0.5]
    assert density_p_value(SphereCells([0, 0, 1]), lambda w: np.where(w[:, 2] > 0.5, cosine_density(w), 0), kept, N) > 0.01
    assert density_p_value(SphereCells([0, 0, 1]), cosine_density, kept, N) < 1e-6


def test_square_cells() -> None:
    p = np.random.default_rng(1).random((N, 2))
    p[:, 0] = np.sqrt(p[:, 0])
    assert density_p_value(SquareCells(), lambda q: 2 * q[:, 0], p, N) > 0.01
    assert density_p_value(SquareCells(), lambda q: np.ones(len(q)), p, N) < 1e-6
