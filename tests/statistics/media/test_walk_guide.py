"""The guide of random walks below surfaces: its diffusion length, the density of its mixture, and its weights."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import kernels
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces.surface_cases import random_numbers

N = 400_000
SIGNIFICANCE = 0.01 / 12  # Bonferroni
GUIDED = 0.6
SKIN = ((10.0, 25.0, 50.0), (0.995, 0.93, 0.88))
Doubles = npt.NDArray[np.float64]


def diffusion_length(albedo: float) -> float:
    """Root of Dwivedi's equation, albedo nu / 2 ln((nu + 1) / (nu - 1)) = 1, by bisection."""
    low, high = 1 + 1e-15, 1e6
    for _ in range(200):
        nu = (low + high) / 2
        low, high = (nu, high) if albedo * nu * math.atanh(1 / nu) > 1 else (low, nu)
    return nu


def fitted_length(albedo: float) -> float:
    return 1 / math.sqrt(1 - albedo ** (2.44294 - 0.0215813 * albedo + 0.578637 / albedo))


def walk(extinction: tuple[float, ...], albedo: tuple[float, ...], g: float, beta: tuple[float, ...], cosine: float) -> Any:
    return np.array([*extinction, *albedo, g, *beta, cosine], np.float32)


def shares(
    extinction: tuple[float, ...], albedo: tuple[float, ...], g: float, beta: tuple[float, ...], middle: float
) -> Doubles:
    """Of each channel's guide, among all directions."""
    most = [math.tanh(abs(middle) * e / fitted_length(a) / 2) for e, a in zip(extinction, albedo, strict=True)]
    return GUIDED * (1 - abs(g)) ** 2 * np.array(most) * np.array(beta) / sum(beta)


@pytest.mark.parametrize("albedo", [0.3, 0.5, 0.8, 0.9, 0.99, 0.999])
def test_the_fit_is_of_dwivedis_equation(albedo: float) -> None:
    assert fitted_length(albedo) == pytest.approx(diffusion_length(albedo), rel=1e-2)


@pytest.mark.parametrize("g", [0.0, 0.4, -0.3])
@pytest.mark.parametrize("middle", [0.05, -0.3])
def test_directions_have_the_density_of_the_mixture(middle: float, g: float) -> None:
    beta, cosine = (0.5, 0.3, 0.7), -0.4
    found = kernels().walk_directions(random_numbers(N, 2, seed=7), walk(*SKIN, g, beta, cosine), middle)
    guided = shares(*SKIN, g, beta, middle)
    side, came = math.copysign(1, middle), np.array((math.sqrt(1 - cosine**2), 0.0, cosine))

    def density(at: Doubles) -> Doubles:
        w, c = side * at[:, 2], at @ came
        total = (1 - guided.sum()) * (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * c) ** 1.5)
        for share, albedo in zip(guided, SKIN[1], strict=True):
            nu = fitted_length(albedo)
            total = total + share / (2 * math.pi * (nu - w) * math.log((nu + 1) / (nu - 1)))
        return np.asarray(total)

    d = np.asarray(found[:, :3], np.float64)
    assert density_p_value(SphereCells((0, 0, 1)), density, d, N) > SIGNIFICANCE
    np.testing.assert_allclose(found[:, 3] / found[:, 4], density(d), rtol=2e-4)
    assert density_p_value(SphereCells((0, 0, 1)), lambda at: density(at * (1, 1, -1)), d, N) < SIGNIFICANCE


@pytest.mark.parametrize("cosine", [0.9, -0.7])
@pytest.mark.parametrize("middle", [1e30, 0.02, -0.5])
def test_steps_collide_and_end_as_often_as_the_medium_says(middle: float, cosine: float) -> None:
    """Throughputs over many steps of one direction: of collisions, of ends, and of collisions times their distance."""
    beta, end = np.array((0.5, 0.3, 0.7)), 0.04
    extinction, albedo = np.array(SKIN[0]), np.array(SKIN[1])
    found = kernels().walk_distances(random_numbers(N, 2, seed=9), walk(*SKIN, 0.0, tuple(beta), cosine), middle, end)
    t, after, collides = (np.asarray(x, np.float64) for x in (found[:, 0], found[:, 1:4], found[:, 4] == 1))
    depth = extinction * end
    left = np.exp(-depth)
    mean_way = (1 - left * (1 + depth)) / extinction
    for value, expected in (
        (after * collides[:, None], beta * albedo * (1 - left)),
        (after * (1 - collides)[:, None], beta * left),
        (after * (collides * t)[:, None], beta * albedo * mean_way),
    ):
        error = value.std(axis=0) / math.sqrt(N)
        np.testing.assert_array_less(np.abs(value.mean(axis=0) - expected), 4.5 * error)


def test_lanes_do_not_show() -> None:
    u, row = random_numbers(1000, 2, seed=3), walk(*SKIN, 0.2, (0.5, 0.3, 0.7), 0.3)
    for call in (
        lambda lanes: kernels().walk_directions(u, row, 0.1, lanes),
        lambda lanes: kernels().walk_distances(u, row, 0.1, 0.05, lanes),
    ):
        np.testing.assert_array_equal(call(1), call(0))
