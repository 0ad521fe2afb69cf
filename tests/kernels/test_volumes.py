"""Grids of voxels: their values, and estimates of transmittance and distance against integrals of interpolated values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from primray.core.native import module

Array = npt.NDArray[Any]
GRAY = (1.0, 1.0, 1.0)


@dataclass
class Dense:
    """The reference of a grid: all voxels of a box, 0 outside. `first`: the lowest voxel, a multiple of 8."""

    voxels: Array
    first: tuple[int, int, int] = (0, 0, 0)

    def at(self, places: Array) -> Array:
        q = places - np.array(self.first)
        inside = ((q >= 0) & (q < self.voxels.shape)).all(-1)
        x, y, z = np.moveaxis(np.clip(q, 0, np.array(self.voxels.shape) - 1), -1, 0)
        return np.where(inside, self.voxels[x, y, z], 0.0)

    def interpolated(self, points: Array) -> Array:
        below = np.floor(points).astype(int)
        part = points - below
        found = np.zeros(len(points))
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(corner, part, 1.0 - part), axis=-1)
            found += weight * self.at(below + np.array(corner))
        return found

    def depth(self, origin: Array, direction: Array, end: float) -> tuple[Array, Array]:
        """Return distances, and the integral of the values up to each."""
        distances = np.linspace(0.0, end, 20_001)
        values = self.interpolated(origin + direction * ((distances[1:] + distances[:-1]) / 2)[:, None])
        return distances, np.concatenate([[0.0], np.cumsum(values) * (end / 20_000)])

    def table(self, is_half: bool = False) -> Any:
        """Return a GridTable with this grid, of the leaves that are not empty."""
        origins, blocks = [], []
        padded = np.pad(self.voxels, [(0, -size % 8) for size in self.voxels.shape])
        for x, y, z in np.ndindex(*(size // 8 for size in padded.shape)):
            block = padded[8 * x : 8 * x + 8, 8 * y : 8 * y + 8, 8 * z : 8 * z + 8]
            if block.any():
                origins.append(np.array(self.first) + 8 * np.array((x, y, z)))
                blocks.append(block.ravel())
        values = np.array(blocks, np.float32)
        return table_of(origins, values.astype(np.float16).view(np.uint16) if is_half else values)


def table_of(origins: Any, values: Array, tiles: Any = (), tile_values: Any = ()) -> Any:
    table = module().testing.GridTable()
    table.add(
        np.array(origins, np.int32).reshape(-1, 3),
        values,
        np.array(tiles, np.int32).reshape(-1, 4),
        np.array(tile_values, values.dtype),
    )
    return table


def cloud() -> Dense:
    """Peaks, empty slabs and a block of one value."""
    voxels = np.random.default_rng(3).random((40, 40, 40)).astype(np.float32) ** 3
    voxels[10:20] = 0.0
    voxels[24:33, 24:33, 24:33] = 0.5
    return Dense(voxels, (-16, 0, 8))


def checker() -> Dense:
    """Leaves of 0 and 1 in turn: where a majorant misses what interpolation reaches, too much light passes."""
    x, y, z = np.indices((6, 6, 6))
    return Dense(np.kron((x + y + z) % 2, np.ones((8, 8, 8))).astype(np.float32), (-24, -24, -24))


def estimates(
    table: Any, origin: Any, direction: Any, end: float, extinction: Any, count: int = 20_000
) -> tuple[Any, Any, Any]:
    """Return transmittances, and collisions of paths with throughput 1: (happens, distance, throughput)."""
    rays = np.tile(np.array([*origin, *direction, 0.0, end], np.float32), (count, 1))
    of_rays = np.tile(np.array(extinction, np.float32), (count, 1))
    seeds = np.arange(count, dtype=np.int32)
    beta = np.ones((count, 3), np.float32)
    return table.transmittance(0, rays, of_rays, seeds), table.collisions(0, rays, of_rays, beta, seeds + count), rays


RAYS = [
    ((-40.0, 20.3, 30.2), (1.0, 0.01, 0.02), 0.3),
    ((-40.0, -10.0, -5.0), (0.6, 0.5, 0.55), 0.2),
    ((30.0, 33.0, 50.0), (-0.7, -0.3, -0.6), 1.0),
    ((-10.0, 8.0, -20.0), (0.0, 0.0, 1.0), 0.2),  # along an edge of leaves
    ((5.0, 16.0, 100.0), (0.0, 0.0, -1.0), 0.1),
    ((1.0, 20.0, 20.0), (0.1, 0.2, 0.9), 0.4),  # from inside
]


@pytest.mark.parametrize("is_half", [False, True])
def test_values_are_those_of_the_voxels(is_half: bool) -> None:
    grid = cloud()
    places = np.random.default_rng(1).integers(-40, 60, (20_000, 3)).astype(np.int32)
    wanted = grid.at(places).astype(np.float16 if is_half else np.float32).astype(np.float32)
    for lanes in (0, 1):
        assert (grid.table(is_half).voxels(0, places, lanes) == wanted).all()


@pytest.mark.parametrize("is_half", [False, True])
def test_ranges_are_those_of_the_voxels(is_half: bool) -> None:
    greatest = cloud().voxels.max()
    assert cloud().table(is_half).range(0) == (0.0, np.float16(greatest) if is_half else greatest)


def test_halves_are_exact_denormals_too() -> None:
    finite = np.arange(31 << 10, dtype=np.uint16)
    halves = np.concatenate([finite, finite | 0x8000])
    leaves = np.pad(halves, (0, -len(halves) % 512)).reshape(-1, 512)
    table = table_of([(0, 0, 8 * k) for k in range(len(leaves))], leaves)
    z, y, x = np.meshgrid(np.arange(8 * len(leaves)), np.arange(8), np.arange(8), indexing="ij")
    places = np.stack([x, y, z], -1).reshape(-1, 3).astype(np.int32)
    wanted = leaves.reshape(-1, 8, 8, 8)[places[:, 2] // 8, places[:, 0], places[:, 1], places[:, 2] % 8]
    assert (table.voxels(0, places) == wanted.view(np.float16).astype(np.float32)).all()


@pytest.mark.parametrize("grid", [cloud(), checker()], ids=["cloud", "checker"])
@pytest.mark.parametrize("is_half", [False, True])
@pytest.mark.parametrize(("origin", "direction", "extinction"), RAYS)
def test_transmittance_and_distances(grid: Dense, origin: Any, direction: Any, extinction: float, is_half: bool) -> None:
    distances, depth = grid.depth(np.array(origin), np.array(direction), 150.0)
    passes = np.exp(-extinction * depth[-1])
    transmittance, (happens, t, _), _ = estimates(grid.table(is_half), origin, direction, 150.0, extinction * np.array(GRAY))
    error = max(transmittance[:, 0].std() / np.sqrt(len(t)), 1e-6)
    assert abs(transmittance[:, 0].mean() - passes) < 4.5 * error + 1e-5 * passes
    assert transmittance.min() >= 0.0
    assert transmittance.max() <= 1.0
    assert abs((1.0 - happens).mean() - passes) < 4.5 * np.sqrt(passes * (1.0 - passes) / len(t)) + 1e-5
    for part in (0.1, 0.5, 0.9):
        wanted = part * (1.0 - passes)
        at = min(np.searchsorted(extinction * depth, -np.log1p(-wanted)), len(distances) - 1)
        found = ((t < distances[at]) & (happens > 0)).mean()
        assert abs(found - wanted) < 4.5 * np.sqrt(wanted * (1.0 - wanted) / len(t)) + 1e-4


@pytest.mark.parametrize(("origin", "direction", "extinction"), RAYS)
def test_coloured_extinction(origin: Any, direction: Any, extinction: float) -> None:
    grid = cloud()
    channels = extinction * np.array([1.0, 0.5, 0.2])
    _, depth = grid.depth(np.array(origin), np.array(direction), 150.0)
    passes = np.exp(-channels * depth[-1])
    transmittance, (happens, _, beta), _ = estimates(grid.table(), origin, direction, 150.0, channels)
    assert np.abs(beta.sum(axis=1) - 3.0).max() < 1e-4, "events keep the sum of the throughput"
    escaped = beta * (happens == 0)[:, None]
    for found in (transmittance, escaped):
        assert (np.abs(found.mean(axis=0) - passes) < 4.5 * found.std(axis=0) / np.sqrt(len(found)) + 1e-5).all()


@pytest.mark.parametrize("side", [8, 128, 4096])
def test_tiles(side: int) -> None:
    """A tile is a cube of one value: known exactly inside, and interpolated over its last voxel outside."""
    values = np.zeros((0, 512), np.float32)
    table = table_of([], values, [(0, 0, 0, side)], [0.25])
    assert table.range(0) == (0.0, 0.25)
    inside = np.array([[0, 0, 0], [side - 1, side - 1, side - 1], [-1, 0, 0], [0, side, 0]], np.int32)
    assert list(table.voxels(0, inside)) == [0.25, 0.25, 0.0, 0.0]
    middle = (side / 2, side / 2)
    transmittance, _, _ = estimates(table, (-10.0, *middle), (1.0, 0.0, 0.0), side + 20.0, np.array([4.0, 2.0, 1.0]) / side)
    wanted = np.exp(-0.25 * np.array([4.0, 2.0, 1.0]))
    assert (np.abs(transmittance.mean(axis=0) - wanted) < 4.5 * transmittance.std(axis=0) / np.sqrt(len(transmittance))).all()


def test_a_cell_of_one_value_has_no_variance() -> None:
    values = np.zeros((0, 512), np.float32)
    table = table_of([], values, [(0, 0, 0, 4096)], [0.5])
    transmittance, _, _ = estimates(table, (500.0, 1000.0, 2000.0), (0.6, 0.0, 0.8), 1000.0, (1e-3, 2e-3, 3e-3), 100)
    assert np.ptp(transmittance, axis=0).max() == 0.0
    assert transmittance[0] == pytest.approx(np.exp([-0.5, -1.0, -1.5]), rel=1e-5)


@pytest.mark.parametrize("extinction", [1e-9, 1e3, 1e6])
def test_extreme_densities(extinction: float) -> None:
    transmittance, (happens, t, _), _ = estimates(cloud().table(), *RAYS[0][:2], 150.0, extinction * np.array(GRAY), 2000)
    if extinction < 1.0:
        assert transmittance.min() > 1.0 - 1e-6
        assert not happens.any()
    else:
        assert transmittance.max() == 0.0
        assert happens.all()
        assert t.max() < 26.0, "within the first voxels of the grid"


def test_an_empty_grid_has_nothing() -> None:
    table = table_of([], np.zeros((0, 512), np.float32))
    transmittance, (happens, _, _), _ = estimates(table, (0, 0, 0), (1, 0, 0), 100.0, GRAY, 100)
    assert (transmittance == 1.0).all()
    assert not happens.any()


def test_lanes_do_not_show() -> None:
    table = cloud().table()
    rng = np.random.default_rng(5)
    rays = np.concatenate(
        [rng.uniform(-40, 60, (999, 3)), rng.normal(size=(999, 3)), np.zeros((999, 1)), rng.uniform(10, 90, (999, 1))], 1
    )
    of_rays = rng.uniform(0.0, 0.5, (999, 3)).astype(np.float32)
    beta = rng.uniform(0.1, 1.0, (999, 3)).astype(np.float32)
    arguments = (rays.astype(np.float32), of_rays)
    seeds = np.arange(999, dtype=np.int32)
    assert (table.transmittance(0, *arguments, seeds, 0) == table.transmittance(0, *arguments, seeds, 1)).all()
    for wide, one in zip(
        table.collisions(0, *arguments, beta, seeds, 0), table.collisions(0, *arguments, beta, seeds, 1), strict=True
    ):
        assert (wide == one).all()
