"""Sampling, density and value of OpenPBR surfaces agree with one another, on all numbers of lanes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces.open_pbr.open_pbr_cases import CASES, Floats, direction, evaluate, sample, strata, surface

COSINES = (1.0, 0.7, 0.2)
SEEN = [(name, cosine, True) for name in CASES for cosine in COSINES]
SEEN += [
    (n, c, False) for n, case in CASES.items() if case.get("transmission_weight") and not case.get("thin") for c in (0.8, 0.4)
]
SIGNIFICANCE = 0.01 / len(SEEN)  # Bonferroni: 1 % over all
N = 40_000


def seed_of(name: str, cosine: float) -> int:
    return sum(map(ord, name)) + round(1000 * cosine)


def uniform(n: int, seed: int) -> np.ndarray:
    return np.minimum(np.random.default_rng(seed).random((n, 3), np.float32), np.float32(1 - 2**-24))


def cells(name: str, cosine: float, front: bool) -> SphereCells:
    """Small ones about where the narrowest lobe goes."""
    case = CASES[name]
    x, y, _ = direction(cosine)
    if case.get("transmission_weight") and not case.get("thin"):
        eta = case.get("specular_ior", 1.5) if front else 1 / case.get("specular_ior", 1.5)
        z = -np.sqrt(max(1 - (1 - cosine**2) / eta**2, 0.0))
        return SphereCells(
            np.array([-x / eta, -y / eta, z], np.float32), growth=3.0, rings=90 if case.get("coat_weight") else 60, points=24
        )
    narrow = case.get("specular_roughness", 0.3) < 0.2 or case.get("coat_roughness", 1.0) < 0.25
    axis = np.array([-x, -y, cosine], np.float32)
    return SphereCells(axis, growth=6.0, rings=60, points=16) if narrow else SphereCells(axis, growth=2.0, rings=36, points=12)


@pytest.mark.parametrize(("name", "cosine", "front"), SEEN)
def test_samples_follow_the_density(name: str, cosine: float, front: bool) -> None:
    made, wo = surface(CASES[name]), direction(cosine)
    wi, _, pdf, is_delta, _ = sample(made, wo, uniform(N, seed_of(name, cosine)), front)
    smooth = ~is_delta.astype(bool) & (pdf > 0)
    assert density_p_value(cells(name, cosine, front), lambda w: evaluate(made, wo, w, front)[2], wi[smooth], N) > SIGNIFICANCE


@pytest.mark.parametrize("name", CASES)
def test_weight_times_density_is_the_value(name: str) -> None:
    made = surface(CASES[name])
    for cosine in (*COSINES, 0.01):
        for front in (True, False):
            wo = direction(cosine)
            wi, weight, pdf, is_delta, transmits = sample(made, wo, uniform(4096, 5), front)
            assert np.isfinite(wi).all()
            assert np.isfinite(weight).all()
            assert (weight >= 0).all()
            np.testing.assert_allclose(np.linalg.norm(wi[weight.max(axis=1) > 0], axis=1), 1, atol=3e-6)
            drawn = (pdf > 0) & ~is_delta.astype(bool)
            assert (np.sign(wi[drawn, 2]) == np.where(transmits[drawn], -1, 1)).all()
            diffuse, others, density = evaluate(made, wo, wi, front)
            np.testing.assert_allclose(density[drawn], pdf[drawn], rtol=2e-3)
            value = (diffuse + others)[drawn]
            np.testing.assert_allclose(
                weight[drawn] * pdf[drawn, None], value, rtol=2e-3, atol=1e-5 * max(value.max(initial=0), 1)
            )


@pytest.mark.parametrize("name", CASES)
def test_a_lane_has_the_same_bits_alone(name: str) -> None:
    made, wo = surface(CASES[name]), direction(0.6)
    for front in (True, False):
        for many, alone in zip(
            sample(made, wo, strata(24, 9), front), sample(made, wo, strata(24, 9), front, lanes=1), strict=True
        ):
            np.testing.assert_array_equal(many, alone)


@pytest.mark.parametrize("name", CASES)
def test_values_are_what_samples_bring(name: str) -> None:
    """What is sampled adds up to what quadrature finds of the value, by colour."""
    case = CASES[name]
    if case.get("specular_roughness", 0.3) < 0.05 or case.get("coat_roughness", 1.0) < 0.05:
        pytest.skip("a mirror")
    made, wo = surface(case), direction(0.6)
    for front in (True, False):
        _, weight, pdf, is_delta, _ = sample(made, wo, strata(256, 3), front)
        smooth = (pdf > 0) & ~is_delta.astype(bool)
        sampled = np.where(smooth[:, None], weight, 0).astype(float).mean(0)
        found = [integral(name, made, wo, front, channel) for channel in range(3)]
        np.testing.assert_allclose(sampled, found, atol=8e-3)


def integral(name: str, made: Any, wo: Floats, front: bool, channel: int) -> float:
    """Of the value over all directions, by quadrature."""

    def value(w: npt.NDArray[Any]) -> npt.NDArray[Any]:
        diffuse, others, _ = evaluate(made, wo, w, front)
        return np.asarray(diffuse[:, channel] + others[:, channel])

    return float(cells(name, 0.6, front).integrate(value).sum())
