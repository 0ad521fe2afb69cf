"""Fibres of hair: nothing is lost or won, sampling, density and value agree on all numbers of lanes, values are the text's."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces.hair.hair_cases import CASES, direction, hair_widths, surface
from tests.statistics.surfaces.open_pbr.open_pbr_cases import evaluate, sample, strata

SEEN = [(name, theta, phi) for name in CASES for theta, phi in ((0.0, 0.0), (0.5, 0.6), (-0.9, -1.3))]
SIGNIFICANCE = 0.01 / len(SEEN)  # Bonferroni: 1 % over all
N = 40_000
MOSTLY_WHITE = [name for name, case in CASES.items() if not {"absorption", "tint_r"} & set(case)]


def uniform(n: int, seed: int) -> npt.NDArray[np.float32]:
    return np.minimum(np.random.default_rng(seed).random((n, 3), np.float32), np.float32(1 - 2**-24))


def sphere(n: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Gauss's nodes of the sine of the inclination times even azimuths, (N, 3), and their solid angles."""
    x, weight = np.polynomial.legendre.leggauss(n)
    phi = (np.arange(2 * n) + 0.5) * np.pi / n
    s, a = np.meshgrid(x, phi, indexing="ij")
    c = np.sqrt(1 - s * s)
    return np.stack([s, c * np.sin(a), c * np.cos(a)], -1).reshape(-1, 3), np.repeat(weight * np.pi / n, 2 * n)


@pytest.mark.parametrize("name", MOSTLY_WHITE)
def test_white_fibres_in_a_white_sky_are_white(name: str) -> None:
    """By quadrature of the value, within 1e-4 and what nodes are apart, at any angle and width."""
    wi, solid = sphere(400)
    made = surface(CASES[name])
    for theta in (0.0, 0.4, -0.8, 1.3, 1.5):
        for phi in (0.0, 0.7, -1.2, 1.5):
            _, value, pdf = evaluate(made, direction(theta, phi), wi)
            np.testing.assert_allclose(value.astype(float).T @ solid, 1.0, atol=3e-4)
            np.testing.assert_allclose(pdf.astype(float) @ solid, 1.0, atol=3e-4)


@pytest.mark.parametrize("beta", [0.001, 0.01, 0.05, 0.3, 1.0])
def test_white_fibres_are_white_by_sampling(beta: float) -> None:
    made = surface(hair_widths(beta, beta))
    for theta in (0.0, 0.6, -1.2):
        _, weight, pdf, _, _ = sample(made, direction(theta, 0.8), strata(256, 3))
        assert (pdf > 0).all()
        assert weight.astype(float).mean() == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("name", "theta", "phi"), SEEN)
def test_samples_follow_the_density(name: str, theta: float, phi: float) -> None:
    made, wo = surface(CASES[name]), direction(theta, phi)
    wi, _, pdf, _, _ = sample(made, wo, uniform(N, sum(map(ord, name)) + round(100 * theta)))
    cells = SphereCells(direction(-theta, -phi), growth=2.0, rings=36, points=24)
    assert density_p_value(cells, lambda w: evaluate(made, wo, w)[2], wi[pdf > 0], N) > SIGNIFICANCE


@pytest.mark.parametrize("name", CASES)
def test_weight_times_density_is_the_value(name: str) -> None:
    made = surface(CASES[name])
    for theta, phi in ((0.0, 0.0), (0.7, 1.5), (-1.5, -0.3), (np.pi / 2, 0.0)):
        wo = direction(theta, phi)
        wi, weight, pdf, is_delta, transmits = sample(made, wo, uniform(4096, 5))
        assert np.isfinite(wi).all()
        assert np.isfinite(weight).all()
        assert (weight >= 0).all()
        assert not is_delta.any()
        np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, atol=3e-6)
        assert (np.sign(wi[:, 2]) == np.where(transmits, -1, 1)).all()
        diffuse, value, density = evaluate(made, wo, wi)
        assert not diffuse.any()
        np.testing.assert_allclose(density, pdf, rtol=5e-3)
        np.testing.assert_allclose(weight * pdf[:, None], value, rtol=5e-3, atol=1e-5 * value.max())


@pytest.mark.parametrize("name", CASES)
def test_a_lane_has_the_same_bits_alone(name: str) -> None:
    made, wo = surface(CASES[name]), direction(0.4, 0.9)
    for many, alone in zip(sample(made, wo, strata(24, 9)), sample(made, wo, strata(24, 9), lanes=1), strict=True):
        np.testing.assert_array_equal(many, alone)


def fresnel(cosine: float, eta: float) -> float:
    inside = np.sqrt(1 - (1 - cosine**2) / eta**2)
    s, p = (cosine - eta * inside) / (cosine + eta * inside), (eta * cosine - inside) / (eta * cosine + inside)
    return float((s * s + p * p) / 2)


def scaled_bessel(a: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """e^-a I0(a), by its integral over a period."""
    nodes = np.cos((np.arange(2000) + 0.5) * np.pi / 2000) - 1
    return np.asarray(np.exp(a[:, None] * nodes).mean(1))


def chiang(case: dict[str, Any], wo: npt.NDArray[Any], wi: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The model's text in double precision, one pair of directions and colour after the other: (N, 3)."""
    eta, tilt = case.get("ior", 1.55), case.get("cuticle_tilt", np.float32(0.0349))
    absorption = np.array(case.get("absorption", (0.0, 0.0, 0.0)))
    tints = [np.array(case.get(f"tint_{lobe}", (1.0, 1.0, 1.0))) for lobe in ("r", "tt", "trt", "trt")]
    variances = [case[f"variance_{lobe}"] for lobe in ("r", "tt", "trt", "trt")]
    scales = [case[f"scale_{lobe}"] for lobe in ("r", "tt", "trt", "trt")]
    theta_o, gamma_o = np.arcsin(wo[0]), np.arctan2(wo[1], wo[2])
    theta_t = np.arcsin(np.sin(theta_o) / eta)
    gamma_t = np.arcsin(np.sin(gamma_o) * np.cos(theta_o) / np.sqrt(eta**2 - np.sin(theta_o) ** 2))
    kept = np.exp(-2 * absorption * np.cos(gamma_t) / np.cos(theta_t))
    f = fresnel(float(wo[2]), eta)
    left = [np.full(3, f), (1 - f) ** 2 * kept, (1 - f) ** 2 * kept**2 * f, (1 - f) ** 2 * kept**3 * f**2 / (1 - f * kept)]
    total = np.zeros((len(wi), 3))
    theta_i, phi = np.arcsin(np.clip(wi[:, 0], -1, 1)), np.arctan2(wi[:, 1], wi[:, 2]) - gamma_o
    for p in range(4):
        tilted = theta_o + tilt * (2, -1, -4, 0)[p]
        v, s = variances[p], scales[p]
        a, b = np.cos(theta_i) * np.abs(np.cos(tilted)) / v, np.sin(theta_i) * np.sin(tilted) / v
        along = np.exp(a - b - 1 / v) * scaled_bessel(a) / (v * (1 - np.exp(-2 / v)))
        x = phi - (2 * p * gamma_t - 2 * gamma_o + p * np.pi)
        x = np.abs(x - 2 * np.pi * np.round(x / (2 * np.pi)))
        about = np.exp(-x / s) / (s * (1 + np.exp(-x / s)) ** 2 * np.tanh(np.pi / (2 * s)))
        total += (along * (about if p < 3 else 1 / (2 * np.pi)))[:, None] * left[p] * tints[p]
    return total


@pytest.mark.parametrize("name", CASES)
def test_values_are_the_texts(name: str) -> None:
    wi, _ = sphere(24)
    made = surface(CASES[name])
    for theta, phi in ((0.0, 0.2), (0.5, 0.9), (-1.0, -1.1)):
        wo = direction(theta, phi)
        value = evaluate(made, wo, wi)[1]
        wanted = chiang(CASES[name], wo.astype(float), wi)
        np.testing.assert_allclose(value, wanted, rtol=2e-3, atol=1e-5 * wanted.max())
