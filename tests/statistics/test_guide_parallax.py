"""Directions that a learnt guide samples on surfaces: drawn by their density, and aimed at what was seen from beside them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import asked, kernels
from tests.kernels.test_guide import DEPTH, room
from tests.statistics.surfaces.surface_cases import random_numbers

from primray import core

N = 200_000
UP = (0.0, 1.0, 0.0)
POINTS = ((-1.1, 0.0, 0.3), (0.7, 0.0, -0.9), (1.3, 0.0, 1.2))  # on the floor
Array = npt.NDArray[Any]


def learn() -> Any:
    return core.module().learn_guide(room("door")._scene, asked(max_depth=DEPTH, splits=2), core.lanes())


@cache
def guide() -> Any:
    return learn()


def directions(points: Any, u: Any, wi: Any, use: Any = None, lanes: int = 0) -> Array:
    """Rows: whether the guide is valid, the sampled direction, its density, the density of `wi`, and the place in the block."""
    shape = (len(u), 3)
    args = [np.ascontiguousarray(np.broadcast_to(a, shape), np.float32) for a in (points, UP)]
    args += [np.ascontiguousarray(u, np.float32), np.ascontiguousarray(np.broadcast_to(wi, shape), np.float32)]
    return np.asarray(kernels().guide_directions(room("door")._scene, use or guide(), *args, lanes=lanes), np.float64)


def even_directions(u: Any) -> Array:
    """Over the hemisphere about y."""
    ring = np.sqrt(1 - u[:, 0] ** 2)
    return np.stack([ring * np.cos(2 * np.pi * u[:, 1]), u[:, 0], ring * np.sin(2 * np.pi * u[:, 1])], axis=1)


def cell_of(d: Array) -> Array:
    """Of 8 rings of 16 sectors of one solid angle."""
    around = np.arctan2(d[:, 2], d[:, 0]) / (2 * np.pi) % 1
    return np.minimum((d[:, 1] * 8).astype(int), 7) * 16 + np.minimum((around * 16).astype(int), 15)


@pytest.mark.parametrize("point", POINTS)
def test_samples_follow_the_density(point: Any) -> None:
    rows = directions(point, random_numbers(N, 2, seed=7), UP)
    assert rows[:, 0].all()
    assert np.linalg.norm(rows[0, 6:]) > 0.02  # beside the middle
    wi = rows[:, 1:4]
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, atol=1e-5)
    assert np.all(wi[:, 1] > 0)

    # The share of directions in each of 8 x 16 cells is the density's integral there.
    even = even_directions(random_numbers(N, 2, seed=8))
    density = directions(point, np.zeros((N, 2)), even)[:, 5] * 2 * np.pi
    assert abs(density.mean() - 1) < 5 * density.std() / N**0.5
    found, cell = np.bincount(cell_of(wi), minlength=128) / N, cell_of(even)
    expected, squares = (np.bincount(cell, density**k, minlength=128) / N for k in (1, 2))
    error = np.sqrt((expected + squares) / N)
    assert np.all(np.abs(found - expected) < 5 * error + 1e-5)
    assert found.max() > 3 / 128  # light comes from somewhere


def test_directions_do_not_depend_on_lanes() -> None:
    u = random_numbers(64, 2, seed=9)
    np.testing.assert_array_equal(directions(POINTS[0], u, UP, lanes=1), directions(POINTS[0], u, UP))


def test_rays_from_beside_each_other_aim_at_one_place() -> None:
    wrong = learn()
    core.module().testing.put_all_in_bin(wrong, 8 * 64 + 20)
    x, z = np.meshgrid(np.linspace(-2, 2, 60), np.linspace(-2, 2, 60))
    points = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    rows = directions(points, np.full((x.size, 2), 0.5), UP, use=wrong)
    d, aside = rows[:, 1:4], rows[:, 6:]
    assert np.abs(aside[:, 1]).max() == 0  # a hemisphere stays one
    along = (aside * d).sum(axis=1)
    reach = np.sqrt(along**2 + 1 - (aside**2).sum(axis=1)) - along
    target = aside + reach[:, None] * d
    np.testing.assert_allclose(target, np.broadcast_to(target[0], target.shape), atol=1e-5)
    assert np.ptp(d, axis=0).max() > 0.2  # and in different directions
