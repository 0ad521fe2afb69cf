"""Light of grids that emit: seen by the camera, on a floor, beside other lights, through and within smoke."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.described import describe, ground, lambert, light, look_at, orthographic, render, rotation, scaling, translation
from tests.images.volumes.voxels import Array, along, block, check, depth_along, glow, grid_of, medium, picture, voxels

from primray.description import LightType, Surface, VolumeEmission, VolumeMedium

SIZE = (32, 32)
ACROSS = along((1, 0, 0), (3.5, 3.5, 3.5))
FIRE = (0.1, 0.2, 0.3)


def seen(emissions: list[VolumeEmission], media: list[VolumeMedium] | None = None, spp: int = 640, **more: Any) -> Array:
    return picture(
        describe(volume_emissions=emissions, media=media or [], resolution=SIZE, **{"camera": ACROSS, **more}), spp
    )  # fmt: skip


@pytest.mark.parametrize("half", [False, True], ids=["float", "half"])
def test_emission_alone(half: bool) -> None:
    check(seen([glow(block(half=half), FIRE)]), 8 * np.array(FIRE))
    check(seen([glow(block(FIRE, half=half), 2.0)]), 16 * np.array(FIRE))
    check(seen([glow(block(FIRE, half=half), FIRE)]), 8 * np.array(FIRE) ** 2)


@pytest.mark.parametrize(
    "matrix", [scaling(2, 1, 1), scaling(-1e-3, 1e-3, 1e-3), scaling(1e3, 1e3, 1e3), rotation((1, 0, 0), 30)]
)
def test_emission_is_by_length_in_the_world(matrix: Array) -> None:
    middle = (matrix @ [3.5, 3.5, 3.5, 1])[:3]
    length = 8 * abs(matrix[0, 0])
    camera = along((1, 0, 0), middle, half=0.01 * length, distance=10 * length)
    check(seen([glow(block(), 1 / length, matrices=[matrix])], camera=camera), 1.0)


def test_emission_of_a_gradient() -> None:
    rng = np.random.default_rng(3)
    values = rng.random((24, 16, 16, 3))
    grid = voxels(values, (-8, 0, 0))
    depth = depth_along(grid, (-20, 7.3, 8.1), (1, 0, 0), 60.0)
    check(seen([glow(grid, FIRE)], camera=along((1, 0, 0), (0, 7.3, 8.1), half=1e-3), spp=1024), depth * FIRE)


def test_a_thin_sheet_is_as_clean_as_a_flame() -> None:
    """Events are spread over the part of the ray in the sheet, not over its diagonal, and light samples are weighed so."""
    grid = voxels(np.random.default_rng(2).random((8, 64, 64)) ** 3)
    depth = depth_along(grid, (-20, 31.3, 30.1), (1, 0, 0), 60.0)
    check(seen([glow(grid)], camera=along((1, 0, 0), (0, 31.3, 30.1), half=1e-3), spp=64), depth, 0.01)
    small = voxels(np.random.default_rng(2).random((2, 14, 14)) ** 3)
    level = translation(3.5, -15, 3.5) @ rotation((0, 0, 1), 90) @ translation(0, -6.5, -6.5)
    check(floor_of([glow(small, matrices=[level])], 2048), irradiance(small, level), 0.005)


def test_emission_of_tiles() -> None:
    tile = grid_of(np.zeros((0, 3)), np.zeros((0, 512, 3), np.float32), [(0, 0, 0, 128)], [FIRE])
    check(seen([glow(tile, 1 / 128)], camera=along((1, 0, 0), (64, 64, 64), distance=200)), FIRE)


def test_emissions_add() -> None:
    check(seen([glow(block(), FIRE), glow(block(FIRE), 1.0), glow(block(), 0.1)], spp=1024), 16 * np.array(FIRE) + 0.8)
    many = [glow(block(), 0.01, matrices=[translation(12.0 * k, 0, 0) for k in range(10)])]
    check(seen(many, camera=along((1, 0, 0), (100, 3.5, 3.5), distance=200), spp=512), 0.8)


@pytest.mark.parametrize("extinction", [0.1, (0.05, 0.1, 0.2)], ids=["gray", "colored"])
def test_emission_within_extinction(extinction: Any) -> None:
    """The values e and k rise and fall together, so that radiance is e / k (1 - exp(-k d))."""
    k = np.broadcast_to(extinction, 3)
    smoke = [medium(block(), extinction)]
    check(seen([glow(block(), FIRE)], smoke, spp=6144), FIRE / k * (1 - np.exp(-8 * k)))


def test_emission_behind_and_before_smoke() -> None:
    smoke = [medium(block(), 0.1)]
    behind, before = (glow(block(), FIRE, matrices=[translation(x, 0, 0)]) for x in (20, -20))
    check(seen([behind], smoke, spp=6144), 8 * np.array(FIRE) * math.exp(-0.8))
    check(seen([before], smoke), 8 * np.array(FIRE))


def test_surfaces_end_emission() -> None:
    wall = ground(20)
    upright = translation(3.5, 0, 0) @ rotation((0, 0, 1), 90)
    check(seen([glow(block(), FIRE)], shapes=[(wall, upright)], surfaces=[lambert(0.0)]), 4 * np.array(FIRE))


def test_bodies_of_lights_end_emission() -> None:
    ball = light(LightType.SPHERE, translation(3.5, 3.5, 3.5), 0.5, radius=1.0)
    pixels = seen([glow(block(), FIRE)], lights=[ball], camera=along((1, 0, 0), (3.5, 3.5, 3.5), half=1e-3))
    check(pixels, 0.5 + 3 * np.array(FIRE))


def floor_of(emissions: list[VolumeEmission], spp: int, media: Any = (), **more: Any) -> Array:
    """Return a spot of a white floor at (3.5, -20, 3.5)."""
    camera = orthographic(look_at((60, 10, 3.5), (3.5, -20, 3.5)), 1e-3)
    floor = (ground(100), translation(0, -20, 0))
    scene = describe(
        [floor, *more.pop("shapes", [])],
        [lambert(1.0), Surface("", opacity=0.0, roughness=0.0, thin=True)],
        volume_emissions=emissions,
        media=media,
        camera=camera,
        resolution=SIZE,
        **more,
    )
    return picture(scene, spp, max_depth=1)


def irradiance(grid: Any, matrix: Array, extinction: float = 0.0) -> Array:
    """Return the irradiance on the floor at (3.5, -20, 3.5), divided by pi, by a sum over points 5 in each voxel's edge."""
    low, high = grid.support
    steps = [np.arange(5 * int(b - a)) / 5 + a + 0.1 for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, 3)
    values = grid.sample(points)
    to = points @ matrix[:3, :3].T + matrix[:3, 3] - np.array([3.5, -20, 3.5])
    distance = np.linalg.norm(to, axis=1)
    weight = to[:, 1] / distance**3 * abs(np.linalg.det(matrix)) / 125 / math.pi
    return (values.T * weight).sum(axis=-1)


TURNED = translation(3.5, -5, 3.5) @ rotation((1, 1, 0), 40) @ scaling(1, 0.6, -1.2) @ translation(-4, -4, -4)


@pytest.mark.parametrize("matrix", [np.eye(4), TURNED], ids=["plain", "turned"])
@pytest.mark.parametrize("kind", ["block", "flames"])
def test_emission_lights_a_floor(kind: str, matrix: Array) -> None:
    flames = np.random.default_rng(1).random((12, 12, 12, 3)).astype(np.float32) ** 3
    grid = block() if kind == "block" else voxels(flames)
    wanted = irradiance(grid, matrix)
    check(floor_of([glow(grid, 1.0, matrices=[matrix])], 6144), wanted, 0.003)


def test_emission_beside_other_lights() -> None:
    """Light samples choose among all lights, and rays that cross the emission are weighed with the same probabilities."""
    grid = voxels(np.random.default_rng(1).random((12, 12, 12)))
    wanted = irradiance(grid, np.eye(4))
    lights = [light(LightType.SPHERE, translation(23.5, 0, 3.5), 4.0, radius=2.0), light(LightType.DOME, emission=0.03)]
    for others in (lights[:1], lights):
        alone = floor_of([], 1024, lights=others)
        check(floor_of([glow(grid, 1.0)], 3072, lights=others), alone.mean(axis=(0, 1)) + wanted, 0.003)


def test_emission_beside_many_lights() -> None:
    """Among many lights a tree chooses, and those that rays seldom hit are found by light samples alone."""
    grid = voxels(np.random.default_rng(1).random((12, 12, 12)))
    wanted = irradiance(grid, np.eye(4))
    rng = np.random.default_rng(5)
    lamps = [light(LightType.SPHERE, translation(*rng.uniform(-30, 30, 3)), 0.05, radius=0.5) for _ in range(200)]
    lamps = [x for x in lamps if x.world_from_light[1, 3] > -15]
    alone = floor_of([], 256, lights=lamps)
    check(floor_of([glow(grid, 1.0)], 6144, lights=lamps), alone.mean(axis=(0, 1)) + wanted, 0.003)


def test_emissions_of_many_instances_light_a_floor() -> None:
    places = [translation(4.0 * x, 2.0 * y, 3.0 * x - 20) @ scaling(0.5, 0.5, 0.5) for x in range(-3, 4) for y in range(-3, 4)]
    grid = block(side=4)
    wanted = sum(irradiance(grid, m) for m in places)
    check(floor_of([glow(grid, 1.0, matrices=places)], 2048), wanted, tolerance=0.007)


def test_through_a_thin_window() -> None:
    """A window that only transmits changes nothing but by its reflectance, the same for light samples and rays."""
    window = (ground(100, surface=1), translation(0, -12, 0))
    grid = block()
    plain = irradiance(grid, np.eye(4))
    found = floor_of([glow(grid, 1.0)], 256, shapes=[window])
    assert (found.mean(axis=(0, 1)) < plain).all()
    assert (found.mean(axis=(0, 1)) > 0.85 * plain).all()


def test_flames_do_not_cover() -> None:
    scene = describe(volume_emissions=[glow(block(), FIRE)], camera=ACROSS, resolution=SIZE).build()
    assert (render(scene, 16).pixels()[..., 3] == 0.0).all()
