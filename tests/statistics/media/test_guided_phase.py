"""Directions inside media that a learnt guide and a phase function sample together: drawn by their density, which is exact."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import asked, kernels
from tests.kernels.foggy_room import DEPTH, room
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.media.phases import DROPLETS
from tests.statistics.surfaces.surface_cases import random_numbers

from primray import core

N = 200_000
PHASES = (0.0, 0.7, -0.4, DROPLETS + 2.0)
POINTS = ((-1.5, 1.0, -1.0), (1.0, 2.0, 2.0))  # in the spot's beam, and far from it
SIGNIFICANCE = 0.01 / (len(PHASES) * len(POINTS))  # Bonferroni: 1 % over the chi-square tests of this file
Array = npt.NDArray[Any]


@cache
def guide() -> Any:
    return core.module().learn_guide(room()._scene, asked(max_depth=DEPTH, splits=1), core.lanes())


def scattered(point: Any, phase: float, u: Any, wi: Any, lanes: int = 0, use: Any = None) -> Array:
    """Rows: whether the guide is valid, the sampled direction, its density and weight, and the density of `wi`."""
    p = np.broadcast_to(np.asarray(point, np.float32), (len(u), 3))
    args = [np.ascontiguousarray(a, np.float32) for a in (p, u, wi)]
    return np.asarray(kernels().scatter_inside(room()._scene, use or guide(), phase, *args, lanes=lanes), np.float64)


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("point", POINTS)
def test_samples_follow_the_density(point: Any, phase: float) -> None:
    u = random_numbers(N, 2, seed=7)
    rows = scattered(point, phase, u, np.zeros((N, 3)) + (0, 0, 1))
    assert rows[:, 0].all()
    wi = rows[:, 1:4]

    def density(w: Any) -> Array:
        flat = w.reshape(-1, 3)
        return scattered(point, phase, np.zeros((len(flat), 2)), flat)[:, 6].reshape(w.shape[:-1])

    assert density_p_value(SphereCells((0, 0, 1), growth=2, points=40), density, wi, N) > SIGNIFICANCE
    np.testing.assert_allclose(rows[:, 4], density(wi), rtol=2e-3)  # what is sampled has the density that it is told
    cosine = np.stack([wi[:, 2], np.full(N, phase)], axis=1).astype(np.float32)
    by_phase = kernels().phase_density(cosine)
    np.testing.assert_allclose(rows[:, 5], by_phase / rows[:, 4], rtol=2e-3)


def test_a_region_knows_where_light_comes_from() -> None:
    """Of the pool of light; half of the rays are the phase function's, which is even."""
    point = np.array((-0.5, 1.0, 0.0))
    to_pool = np.array((-1.5, 0.0, -1.0)) - point
    to_pool /= np.linalg.norm(to_pool)
    there, away = (scattered(point, 0.0, np.zeros((1, 2)), w[None])[0, 6] * 4 * np.pi for w in (to_pool, -to_pool))
    assert there > 2.0
    assert away < 1.0


def test_rows_do_not_depend_on_lanes() -> None:
    u = random_numbers(1000, 2, seed=11)
    one, many = (scattered(POINTS[0], 0.3, u, np.zeros((1000, 3)), lanes) for lanes in (1, core.lanes()))
    np.testing.assert_array_equal(one, many)
