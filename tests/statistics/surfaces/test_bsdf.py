"""Sampling, density and value of the one surface model agree with one another, for every kind of surface."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import kernels
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces.surface_cases import (
    NON_TRANSMISSIVE,
    SURFACES,
    direction,
    evaluate,
    random_numbers,
    rows,
    sample,
    side,
)

from primray.core.inputs import surface_input

COSINES = (1.0, 0.7, 0.2)
CASES = [(name, cos, True) for name in SURFACES for cos in COSINES]
CASES += [(name, 0.8, False) for name in SURFACES if SURFACES[name].opacity < 1] + [
    ("rough glass", 0.5, False),
    ("dielectric 0.3", 0.5, False),
]
SIGNIFICANCE = 0.01 / len(CASES)  # Bonferroni: 1 % over all cases
N = 40_000


def mirrored(cos: float) -> np.ndarray:
    return direction(cos) * np.array([-1, -1, 1], np.float32)


def cells(name: str, cos: float) -> SphereCells:
    narrow = SURFACES[name].roughness < 0.15 or "smooth" in name
    if narrow:
        return SphereCells(mirrored(cos), growth=6.0, rings=60, points=16)
    return SphereCells(mirrored(cos), growth=2.0, rings=28, points=10)


@pytest.mark.parametrize(("name", "cos", "front"), CASES)
def test_samples_follow_the_density(name: str, cos: float, front: bool) -> None:
    s, wo = SURFACES[name], direction(cos)
    wi, _, pdf, is_delta, _ = sample(s, wo, random_numbers(N, 3, seed=hash_of(name, cos)), front)
    smooth = ~is_delta & (pdf > 0)
    p = density_p_value(cells(name, cos), lambda w: evaluate(s, wo, w, front)[2], wi[smooth], N)
    assert p > SIGNIFICANCE


@pytest.mark.parametrize("name", SURFACES)
def test_density_integrates_to_the_chance_of_the_smooth_lobes(name: str) -> None:
    s = SURFACES[name]
    for cos in COSINES:
        wo = direction(cos)
        chances, _ = kernels().bsdf_lobes(surface_input(s), rows(wo, 1), side(1))
        diffuse, specular, coat, presence = chances[0].astype(float)
        _, _, pdf, is_delta, _ = sample(s, wo, random_numbers(N, 3, seed=3))
        # A reflection about a visible normal may go below the horizon: those draws are lost, and no density belongs to them.
        lost = np.mean(~is_delta & (pdf == 0))
        total = float(cells(name, cos).integrate(lambda w: evaluate(s, wo, w)[2]).sum())  # noqa: B023
        smooth = (diffuse + (0.0 if s.roughness == 0 else specular) + coat) * presence
        assert total == pytest.approx(smooth - lost, abs=5e-3)


@pytest.mark.parametrize("name", SURFACES)
def test_weight_times_density_is_the_value(name: str) -> None:
    s = SURFACES[name]
    for cos in (*COSINES, 0.01):
        for front in (True, False):
            wo = direction(cos)
            wi, weight, pdf, is_delta, transmits = sample(s, wo, random_numbers(4096, 3, seed=5), front)
            assert np.isfinite(wi).all()
            assert np.isfinite(weight).all()
            assert (weight >= 0).all()
            np.testing.assert_allclose(np.linalg.norm(wi[weight.max(axis=1) > 0], axis=1), 1, atol=3e-6)
            assert (wi[~transmits & (pdf > 0), 2] > 0).all()
            assert (wi[transmits, 2] <= 0).all()
            smooth = ~is_delta & (pdf > 0)
            diffuse, specular, density = evaluate(s, wo, wi[smooth], front)
            np.testing.assert_allclose(density, pdf[smooth], rtol=1e-5)
            np.testing.assert_allclose(weight[smooth] * pdf[smooth, None], diffuse + specular, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("name", NON_TRANSMISSIVE)
def test_reciprocity(name: str) -> None:
    s = SURFACES[name]
    rng = np.random.default_rng(11)
    z, phi = rng.uniform(0.02, 1, (2, 4096)), rng.uniform(0, 2 * np.pi, (2, 4096))
    r = np.sqrt(1 - z * z)
    a, b = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=2).astype(np.float32)
    there = sum(evaluate(s, a, b)[:2]) / b[:, 2:]
    back = sum(evaluate(s, b, a)[:2]) / a[:, 2:]
    np.testing.assert_allclose(there, back, rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize("name", SURFACES)
def test_lanes_do_not_change_bits(name: str) -> None:
    s, n = SURFACES[name], 1003
    wo = np.stack([direction(c, 9 * c) for c in np.linspace(0.01, 1, n)])
    u = random_numbers(n, 3, seed=7)
    front = (u[:, 2] < 0.5).astype(np.int32)
    row = surface_input(s)
    for one, all_lanes in zip(
        kernels().bsdf_sample(row, wo, front, u, 1), kernels().bsdf_sample(row, wo, front, u), strict=True
    ):
        assert np.array_equal(one, all_lanes)


def test_nothing_below_the_horizon() -> None:
    wi = -np.abs(np.stack([direction(c) for c in np.linspace(0.01, 1, 50)]))
    for s in SURFACES.values():
        for values in evaluate(s, direction(0.5), wi):
            assert (values == 0).all()


def hash_of(name: str, cos: float) -> int:
    """A seed that does not change from run to run."""
    return sum(ord(c) * 31**i for i, c in enumerate(name)) % 2**31 + int(1000 * cos)
