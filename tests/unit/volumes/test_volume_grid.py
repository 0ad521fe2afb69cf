"""Lookups in sparse grids: voxels, and trilinear interpolation between their centres."""

from __future__ import annotations

import numpy as np
import pytest
from tests import vdb_writer as vdb

from primray.volumes.vdb_file import list_grids, read_grid
from primray.volumes.volume_grid import VolumeGrid

RNG = np.random.default_rng(11)


def read(written: vdb.Grid) -> VolumeGrid:
    data = vdb.vdb_bytes([written])
    grids = list_grids(data)
    return read_grid(data, grids, grids[0])


@pytest.fixture(scope="module")
def ramp() -> VolumeGrid:
    """A linear function of x, y and z over 24^3 voxels, one leaf of which is a tile of 0."""
    x, y, z = np.meshgrid(*[np.arange(8.0)] * 3, indexing="ij")
    leaves = {}
    for i, j, k in np.ndindex(3, 3, 3):
        origin = (8 * i - 8, 8 * j, 8 * k + 120)
        values = 2 * (x + origin[0]) - (y + origin[1]) + 0.5 * (z + origin[2]) + 100
        leaves[origin] = vdb.Leaf(values.ravel(), np.ones(512, bool))
    return read(vdb.Grid(kind="double", leaves=leaves))


def test_linear_functions_are_interpolated_exactly(ramp: VolumeGrid) -> None:
    points = RNG.uniform((-8, 0, 120), (15, 23, 143), (1000, 3))
    assert np.allclose(ramp.sample(points), points @ [2, -1, 0.5] + 100, atol=1e-9)


def test_centres_are_at_integers(ramp: VolumeGrid) -> None:
    voxels = RNG.integers((-10, -2, 118), (18, 26, 146), (500, 3))
    assert np.array_equal(ramp.sample(voxels.astype(np.float64)), ramp.values_at(voxels))


def test_outside_is_the_background(ramp: VolumeGrid) -> None:
    far = np.array([[-9.0, 0, 120], [1e30, 0, 0], [-1e30, 5, 5], [np.nan, 0, 0], [np.inf, 0, 0], [2147483647.5, 0, 0]])
    assert ramp.sample(far).tolist() == [0] * 6
    assert ramp.sample(np.array([[-8.5, 3, 130]])) == ramp.sample(np.array([[-8.0, 3, 130]])) / 2  # halfway to the background


def test_each_sample_is_the_mean_of_eight_voxels() -> None:
    written = vdb.sample_grid("vec3s")
    grid = read(written)
    points = RNG.uniform((-30, -3, -12), (40, 30, 12), (300, 3))
    first = np.floor(points).astype(int)
    expected = np.zeros((300, 3))
    for corner in np.ndindex(2, 2, 2):
        weight = np.abs(1 - np.array(corner) - (points - first)).prod(1)
        expected += weight[:, None] * vdb.values_of(written, first + corner)
    assert np.allclose(grid.sample(points), expected)
    assert grid.width == 3


def test_an_infinite_neighbour_without_weight_has_no_effect() -> None:
    values = np.zeros(512)
    values[0] = np.inf
    grid = read(vdb.Grid(leaves={(0, 0, 0): vdb.Leaf(values, np.ones(512, bool))}))
    assert grid.sample(np.array([[1.0, 0, 0], [0, 0, 0], [0.5, 0, 0]])).tolist() == [0, np.inf, np.inf]


def test_tiles_and_leaves_of_all_roots_are_found() -> None:
    written = vdb.sample_grid()
    grid = read(written)
    voxels = np.concatenate([RNG.integers(-9000, 9000, (3000, 3)), grid.leaf_origins, grid.tile_origins])
    assert np.array_equal(grid.values_at(voxels), vdb.values_of(written, voxels)[:, 0])
