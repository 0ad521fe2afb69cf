"""Maps from the unit square to discs, normals and pixels have the densities they claim."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import describe, kernels
from tests.statistics.chi_square import SphereCells, SquareCells, density_p_value
from tests.statistics.surfaces.surface_cases import direction, random_numbers

from primray.core.scene import profile
from primray.settings import DEFAULT_FILTER_WIDTH, Filter

N = 100_000
SIGNIFICANCE = 0.01 / 12  # Bonferroni: 1 % over the cases of this file


def test_concentric_disk_is_uniform() -> None:
    p = kernels().concentric_disk(random_numbers(N, 2, seed=1))
    assert (
        density_p_value(SquareCells((-1, -1), (1, 1), points=32), lambda q: (np.sum(q * q, axis=1) <= 1) / np.pi, p, N)
        > SIGNIFICANCE
    )
    radius = np.linalg.norm(p, axis=1)
    assert radius.max() <= 1 + 1e-6


def test_concentric_disk_keeps_neighbours_together() -> None:
    u = (
        np.stack(np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(256) + 0.5) / 256), axis=-1)
        .reshape(-1, 2)
        .astype(np.float32)
    )
    p = kernels().concentric_disk(u).reshape(256, 256, 2)
    # Shirley and Chiu: no step is stretched by more than pi / 2 times the side (2 / 256).
    for axis in (0, 1):
        assert np.linalg.norm(np.diff(p, axis=axis), axis=-1).max() < 2 / 256 * np.pi / 2


def unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


@pytest.mark.parametrize(("alpha", "cos"), [(0.05, 0.8), (0.3, 1.0), (0.3, 0.3), (0.3, 0.02), (1.0, 0.5)])
def test_normals_to_reflect_about(alpha: float, cos: float) -> None:
    """Visible ones (Heitz 2018, "Sampling the GGX Distribution of Visible Normals", eq. 3) on the bounded cap of Eto and
    Tokuyoshi 2023, in double; none is left out that reflects upwards."""
    wo = direction(cos).astype(float)
    bent = unit(wo * [alpha, alpha, 1])
    s = 1 + np.hypot(wo[0], wo[1])
    k = (1 - alpha**2) * s**2 / (s**2 + alpha**2 * cos**2)

    def in_cap(h: np.ndarray) -> np.ndarray:
        normal = unit(h / [alpha, alpha, 1])
        return (2 * (normal @ bent)[:, None] * normal - bent)[:, 2] >= -k * bent[2]

    def density(h: np.ndarray) -> np.ndarray:
        z2 = np.maximum(h[:, 2], 1e-9) ** 2
        d = 1 / (np.pi * alpha**2 * z2**2 * (1 + (1 - z2) / z2 / alpha**2) ** 2)
        scale = 2 / (k * cos + np.sqrt(alpha**2 * (1 - cos * cos) + cos * cos))
        return np.where((h[:, 2] > 0) & in_cap(h), scale * np.maximum(h @ wo, 0) * d, 0)

    h = kernels().reflection_normals(wo.tolist(), alpha, random_numbers(N, 2, seed=2))
    cells = SphereCells([0, 0, 1], growth=2.0, spread=np.pi / 2, points=64)
    assert density_p_value(cells, density, h, N) > SIGNIFICANCE
    anywhere = unit(np.random.default_rng(5).normal(size=(200_000, 3)))
    reflected = 2 * (anywhere @ wo)[:, None] * anywhere - wo
    upwards = (reflected[:, 2] > 1e-6) & (anywhere @ wo > 0) & (anywhere[:, 2] > 0)
    assert in_cap(anywhere[upwards]).all()


@pytest.mark.parametrize("filter", list(Filter))
def test_pixel_filter(filter: Filter) -> None:
    scene = describe().build(filter=filter)
    half = DEFAULT_FILTER_WIDTH[filter] / 2
    p = kernels().filter_offsets(scene, random_numbers(N, 2, seed=3))
    x = np.linspace(-1, 1, 20001)
    cdf = np.cumsum(profile(filter, x))
    exact = np.interp(np.sort(p / half, axis=0), x, cdf / cdf[-1])
    # Kolmogorov and Smirnov: 1.95 / sqrt(N) is exceeded with probability 0.001.
    assert np.abs(exact - ((np.arange(N) + 0.5) / N)[:, None]).max() < 1.95 / np.sqrt(N)
    assert abs(np.corrcoef(p.T)[0, 1]) < 4 / np.sqrt(N)
