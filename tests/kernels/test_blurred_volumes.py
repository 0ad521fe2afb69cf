"""Grids that velocities blur: estimates of transmittance and distance against integrals of displaced values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.kernels.test_volumes import Array, Dense, cloud

FRAME = 0.3
COUNT = 20_000


def velocities(most: float, first: tuple[int, int, int], size: int) -> list[Dense]:
    """Three components that vary from voxel to voxel and over the grid, in a box that is not the cloud's."""
    random = np.random.default_rng(7)
    x, y, z = np.indices((size, size, size)) / size
    waves = [np.sin(6 * x + 2 * y), np.cos(5 * y - 3 * z), np.sin(4 * z + x)]
    return [Dense((most * (0.8 * wave + 0.2 * random.random(wave.shape))).astype(np.float32), first) for wave in waves]


def table_of(density: Dense, moves: list[Dense], is_half: bool) -> tuple[Any, int]:
    """Return a table with a cloud, its velocities, and the blurred cloud, whose number is returned as well."""
    table = density.table(is_half)
    size = moves[0].voxels.shape[0]
    origins, blocks = [], []
    together = np.stack([component.voxels for component in moves], axis=-1)
    for x, y, z in np.ndindex(*(3 * [size // 8])):
        origins.append(np.array(moves[0].first) + 8 * np.array((x, y, z)))
        blocks.append(together[8 * x : 8 * x + 8, 8 * y : 8 * y + 8, 8 * z : 8 * z + 8].ravel())
    table.add(np.array(origins, np.int32), np.array(blocks, np.float32), np.zeros((0, 4), np.int32), np.zeros(0, np.float32), 3)
    return table, table.add_blurred(0, 1, FRAME)


def displaced(density: Dense, moves: list[Dense], points: Array, time: float) -> Array:
    """Return the values at points: of the eight voxels around each, what the velocity of each brings, by their weights."""
    below = np.floor(points).astype(int)
    part = points - below
    found = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, part, 1.0 - part), axis=-1)
        velocity = np.stack([component.at(below + np.array(corner)) for component in moves], axis=-1)
        found += weight * density.interpolated(points - velocity * (time - FRAME))
    return found


RAYS = [
    ((-60.0, 20.3, 30.2), (1.0, 0.01, 0.02), 0.3),
    ((-60.0, -10.0, -5.0), (0.6, 0.5, 0.55), 0.2),
    ((-10.0, 8.0, -40.0), (0.0, 0.0, 1.0), 0.2),  # along an edge of leaves
    ((1.0, 20.0, 20.0), (0.1, 0.2, 0.9), 0.4),  # from inside
]


def gusts(most: float) -> list[Dense]:
    """Velocities that change from leaf to leaf: cells must know those of the first voxels of the leaves above."""
    leaves = np.random.default_rng(11).uniform(-most, most, (3, 8, 8, 8)) * (np.indices((8, 8, 8)).sum(axis=0) % 2)
    return [Dense(np.kron(one, np.ones((8, 8, 8))).astype(np.float32), (-24, -16, -8)) for one in leaves]


def sparks() -> Dense:
    """Few voxels of large values: a cell whose range does not reach far enough misses them."""
    random = np.random.default_rng(12)
    return Dense(np.where(random.random((40, 40, 40)) < 0.004, 8.0, 0.0).astype(np.float32), (-16, 0, 8))


SCENES = {
    "near": (cloud, lambda: velocities(3.0, (-24, -16, 0), 64)),
    "far": (cloud, lambda: velocities(30.0, (-72, -56, -48), 128)),
    "very far": (cloud, lambda: velocities(600.0, (0, 0, 0), 32)),
    "sparks": (sparks, lambda: velocities(12.0, (-24, -16, 0), 64)),
    "sparks, gusts": (sparks, lambda: gusts(14.0)),
}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("is_half", [False, True])
def test_transmittance_and_distances(scene: str, is_half: bool) -> None:
    density, moves = SCENES[scene][0](), SCENES[scene][1]()
    if is_half:
        density = Dense(density.voxels.astype(np.float16).astype(np.float32), density.first)
    table, blurred = table_of(density, moves, is_half)
    for k, (origin, direction, extinction) in enumerate(RAYS):
        for time in (0.0, FRAME, 1.0):
            way = np.array(direction) / np.linalg.norm(direction)
            distances = np.linspace(0.0, 160.0, 8001)
            points = np.array(origin) + way * ((distances[1:] + distances[:-1]) / 2)[:, None]
            depth = np.concatenate([[0.0], np.cumsum(displaced(density, moves, points, time)) * 0.02]) * extinction
            rays = np.tile(np.array([*origin, *way, 0.0, 160.0], np.float32), (COUNT, 1))
            of_rays = np.full((COUNT, 3), extinction, np.float32)
            seeds = np.arange(COUNT, dtype=np.int32) + 100 * k
            found = table.transmittance(blurred, rays, of_rays, seeds, time=time)[:, 0].astype(np.float64)
            wanted = np.exp(-depth[-1])
            error = max(found.std() / np.sqrt(COUNT), 1e-5)
            assert abs(found.mean() - wanted) < 4.5 * error + 2e-4, (origin, time)
            happens, at, _ = table.collisions(blurred, rays, of_rays, np.ones((COUNT, 3), np.float32), seeds + COUNT, time=time)
            # Distances are compared by the optical depth up to them, whose distribution is known.
            passed = np.where(happens > 0, np.interp(at, distances, depth), np.inf)
            for part in (0.25, 0.5, 1.0):
                share = 1 - np.exp(-part * depth[-1])
                assert abs((passed <= part * depth[-1]).mean() - share) < 4.5 * np.sqrt(share * (1 - share) / COUNT) + 2e-4


def test_lanes_do_not_show() -> None:
    table, blurred = table_of(cloud(), velocities(3.0, (-24, -16, 0), 64), False)
    rays = np.random.default_rng(2).normal(size=(500, 8)).astype(np.float32)
    rays[:, :3] = rays[:, :3] * 20 + 10
    rays[:, 6], rays[:, 7] = 0.0, 90.0
    seeds = np.arange(500, dtype=np.int32)
    extinction = np.full((500, 3), 0.2, np.float32)
    first, again = (table.transmittance(blurred, rays, extinction, seeds, lanes=lanes, time=0.9) for lanes in (0, 1))
    np.testing.assert_array_equal(first, again)


def test_no_time_since_the_frame_is_as_without_velocities() -> None:
    """The values are those of the grid; its ranges are wider, so that events are others."""
    table, blurred = table_of(cloud(), velocities(5.0, (-24, -16, 0), 64), False)
    rays = np.tile(np.array([-60.0, 20.3, 30.2, 1.0, 0.01, 0.02, 0.0, 160.0], np.float32), (COUNT, 1))
    extinction, seeds = np.full((COUNT, 3), 0.2, np.float32), np.arange(COUNT, dtype=np.int32)
    still, at_frame = (table.transmittance(grid, rays, extinction, seeds, time=FRAME)[:, 0] for grid in (0, blurred))
    error = np.hypot(still.std(), at_frame.std()) / np.sqrt(COUNT)
    assert abs(still.mean() - at_frame.mean()) < 4.5 * error


def test_ranges_and_boxes_cover_what_is_carried_away() -> None:
    density = Dense(np.ones((8, 8, 8), np.float32), (0, 0, 0))
    moves = [Dense(np.full((64, 64, 64), value, np.float32), (-32, -32, -32)) for value in (10.0, 0.0, -20.0)]
    table, blurred = table_of(density, moves, False)
    assert table.range(blurred) == (0.0, 1.0)
    low, high = np.array(table.box(blurred)).reshape(2, 3)
    assert (low <= [-1 - 10 * FRAME, -1, -1 - 20 * (1 - FRAME)]).all()
    assert (high >= [8 + 10 * (1 - FRAME), 8, 8 + 20 * FRAME]).all()
    assert (low >= [-16, -8, -24]).all()
    assert (high <= [24, 16, 24]).all()
