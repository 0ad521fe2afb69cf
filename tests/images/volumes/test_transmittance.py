"""What is left of light that crosses grids of voxels: exp of minus the integral of the interpolated extinction.

Camera rays see a white sky through the volume; shadow rays cross it between a sun and a floor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from tests.described import (
    describe,
    ground,
    lambert,
    light,
    look_at,
    orthographic,
    perspective,
    render,
    rotation,
    scaling,
    translation,
)
from tests.images.volumes.voxels import (
    TOLERANCE,
    Array,
    along,
    block,
    check,
    depth_along,
    glow,
    grid_of,
    medium,
    picture,
    voxels,
)

from primray.description import Camera, LightType, VolumeMedium

SKY = light(LightType.DOME)
COLORS = (0.05, 0.025, 0.0125)
ACROSS = along((1, 0, 0), (3.5, 3.5, 3.5))
SIZE = (32, 32)


def seen(media: Sequence[VolumeMedium], camera: Camera = ACROSS, spp: int = 2048, **values: Any) -> Array:
    """Return what is left of the white sky behind the media."""
    return picture(describe(lights=[SKY], media=media, camera=camera, resolution=SIZE), spp, **values)


def lit(media: Sequence[VolumeMedium], spp: int = 2048) -> Array:
    """Return what is left of the light of a sun that crosses the media downwards, through (3.5, y, 3.5), to a white floor."""
    sun = light(LightType.DISTANT, rotation((1, 0, 0), -90), math.pi)
    camera = orthographic(look_at((60, -40, 3.5), (3.5, -50, 3.5)), 0.1)
    floor = ground(100)
    scene = describe([(floor, translation(0, -50, 0))], [lambert(1.0)], [sun], camera, SIZE, media=media)
    return picture(scene, spp, max_depth=1)


def passes(depth: Any) -> Array:
    return np.exp(-np.asarray(depth, np.float64))


@pytest.mark.parametrize("extinction", [0.05, COLORS], ids=["gray", "colored"])
@pytest.mark.parametrize("half", [False, True], ids=["float", "half"])
def test_a_box(extinction: Any, half: bool) -> None:
    """The borders, where values fall to 0, have as much as half a voxel on each side."""
    smoke = [medium(block(1.0, half=half), extinction)]
    wanted = passes(8 * np.array(extinction))
    check(seen(smoke), wanted)
    check(lit(smoke), wanted)


def test_within_the_border() -> None:
    """A quarter of a voxel from where values end they are a quarter of those inside."""
    camera = along((1, 0, 0), (3.5, 7.75, 3.5), half=1e-3)
    check(seen([medium(block(), 0.1)], camera), passes(0.8 * 0.25))


def test_a_linear_ramp() -> None:
    ramp = np.broadcast_to(np.arange(1.0, 17.0)[:, None, None], (16, 16, 16))
    smoke = [medium(voxels(ramp), 0.002)]
    check(seen(smoke, along((1, 0, 0), (8, 7.5, 7.5))), passes(0.002 * 136))
    # From the middle on the integral is that of 1 + x, and of what falls from 16 to 0 behind the last voxel.
    camera = orthographic(look_at((5.25, 7.5, 7.5), (50, 7.5, 7.5)), 1.0)
    rest = 16.0 * 9.75 - 9.75**2 / 2 + 8.0
    check(seen(smoke, camera), passes(0.002 * rest))


@pytest.mark.parametrize("direction", [(1, 0.3, 0.2), (-0.2, 0.9, -0.5), (0.3, -0.4, -1)])
def test_a_ramp_along_any_direction(direction: tuple[float, float, float]) -> None:
    x, y, z = np.indices((24, 24, 24))
    grid = voxels(0.5 + 0.01 * x + 0.02 * y + 0.03 * z, (-12, -12, -12))
    d = np.array(direction) / np.linalg.norm(direction)
    depth = depth_along(grid, -50 * d, d, 100.0)
    smoke = [medium(grid, 0.01)]
    check(seen(smoke, along(direction, (0, 0, 0), half=1e-3)), passes(0.01 * depth))


def test_a_ball() -> None:
    """Voxels inside a ball: the integral of the interpolated values, and nearly the chord."""
    places = np.moveaxis(np.indices((48, 48, 48)), 0, -1) - 23.5
    grid = voxels((np.linalg.norm(places, axis=-1) < 20).astype(np.float32))
    for offset in (0.2, 10.3, 17.1):
        origin = np.array([-10, 23.5 + offset, 23.4])
        depth = depth_along(grid, origin, (1, 0, 0), 80.0)
        assert depth == pytest.approx(2 * math.sqrt(400 - offset**2), rel=0.03)
        check(seen([medium(grid, 0.01)], along((1, 0, 0), origin, half=1e-3)), passes(0.01 * depth))


@pytest.mark.parametrize("side", [8, 128, 4096])
def test_tiles_are_the_leaves_that_they_stand_for(side: int) -> None:
    tile = grid_of(np.zeros((0, 3)), np.zeros((0, 512), np.float32), [(0, 0, 0, side)], [0.75])
    middle = (side / 2,) * 3
    camera = along((0, 0, 1), middle, distance=2.0 * side)
    wanted = passes(0.3)
    check(seen([medium(tile, 0.4 / side)], camera), wanted)
    if side == 128:
        check(seen([medium(block(0.75, 128), 0.4 / side)], camera), wanted)
    elif side == 8:
        np.testing.assert_array_equal(
            seen([medium(tile, 0.05)], camera, 64), seen([medium(block(0.75), 0.05)], camera, 64)
        )  # fmt: skip


def test_a_tile_beside_leaves() -> None:
    """Between the last voxel of a tile and the first one of a leaf values are interpolated."""
    leaf = np.full((2, 512), 0.25, np.float32)
    grid = grid_of([(128, 64, 64), (-8, 64, 64)], leaf, [(0, 0, 0, 128)], [0.5])
    smoke = [medium(grid, 0.005)]
    wanted = passes(0.005 * (0.5 * 128 + 0.25 * 16))
    camera = along((1, 0, 0), (64, 67.5, 67.5), distance=200)
    check(seen(smoke, camera), wanted)


SHEARED = np.array([[1, 0.5, 0, 0], [0, 1, 0.25, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
MATRICES = {
    "scaled": scaling(0.5, 2, 3),
    "mirrored": scaling(-1, 1, 1),
    "turned": rotation((1, 2, 3), 40),
    "sheared": SHEARED,
    "all": translation(5, -3, 2) @ rotation((1, 1, 0), 70) @ SHEARED @ scaling(-0.7, 1.4, 1),
    "tiny": scaling(1e-6, 1e-6, 1e-6),
    "huge": scaling(1e3, 1e3, 1e3),
}


@pytest.mark.parametrize("name", MATRICES)
def test_transforms(name: str) -> None:
    """Optical depth is extinction times the length in the world; index space only says where the values are."""
    matrix = MATRICES[name]
    x, y, z = np.indices((16, 16, 16))
    grid = voxels(0.5 + 0.02 * x + 0.03 * y + 0.01 * z)
    size = abs(np.linalg.det(matrix)) ** (1 / 3)
    middle = (matrix @ [7.2, 7.9, 7.4, 1])[:3]
    direction = np.array((0.8, 0.5, 0.4)) / np.linalg.norm((0.8, 0.5, 0.4))
    camera = along(direction, middle, half=1e-3 * size, distance=100 * size)
    inverse = np.linalg.inv(matrix)
    origin = inverse @ [*(middle - 100 * size * direction), 1]
    depth = depth_along(grid, origin[:3], inverse[:3, :3] @ direction, 200 * size)
    factor = 0.3 / depth
    check(seen([medium(grid, factor, matrices=[matrix])], camera), passes(0.3))


def test_far_from_the_origin() -> None:
    moved = translation(1e8, -1e8, 1e8)
    scene = describe(lights=[SKY], media=[medium(block(), 0.04)], camera=ACROSS, resolution=SIZE)
    check(picture(scene.moved(moved), 2048), passes(0.32))
    far = grid_of([(1 << 30, -(1 << 30), 1 << 30)], np.ones((1, 512), np.float32))
    back = translation(-(1 << 30), 1 << 30, -(1 << 30))
    check(seen([medium(far, 0.04, matrices=[back])]), passes(0.32))


def test_from_inside() -> None:
    camera = orthographic(look_at((3.25, 3.5, 3.5), (10, 3.5, 3.5)), 1.0)
    check(seen([medium(block(), 0.06)], camera), passes(0.06 * 4.25))


@pytest.mark.parametrize("plane", [0.0, 7.0, 7.5, -0.5])
def test_rays_along_a_face(plane: float) -> None:
    """All rays are in one plane: of the first voxels' centres, of the last ones', or half way outside."""
    camera = along((0, 0, 1), (plane, 3.5, 3.5), half=1e-6)
    value = np.interp(plane, (-1, 0, 7, 8), (0, 1, 1, 0))
    check(seen([medium(block(), 0.05)], camera), passes(0.4 * value))
    between = voxels(np.ones((16, 16, 16)))
    check(seen([medium(between, 0.02)], along((0, 0, 1), (8.0, 8.0, 8), half=1e-6)), passes(0.32))


def test_two_grids_are_one_of_the_sum() -> None:
    rng = np.random.default_rng(4)
    one, other = rng.random((2, 16, 16, 16)).astype(np.float32)
    camera = along((1, 0, 0), (8, 8.3, 7.6), half=1e-3)
    depth = depth_along(voxels(one + 2 * other), (-10, 8.3, 7.6), (1, 0, 0), 40.0)
    both = [medium(voxels(one), 0.01), medium(voxels(other), 0.02)]
    check(seen(both, camera), passes(0.01 * depth))
    check(seen([medium(voxels(one + 2 * other), 0.01)], camera), passes(0.01 * depth))


def test_colored_grids_that_overlap() -> None:
    one, other = medium(block(), (0.03, 0.01, 0.002)), medium(block(first=(4, 0, 0)), (0.005, 0.02, 0.03))
    check(seen([one, other], spp=4096), passes([8 * 0.035, 8 * 0.03, 8 * 0.032]))
    check(lit([one, medium(block(), (0.005, 0.02, 0.03))]), passes([8 * 0.035, 8 * 0.03, 8 * 0.032]))


def test_grids_that_touch_and_grids_that_are_split() -> None:
    """One grid of 16 voxels has no gap; two of 8 that touch have a linear border each, which add up to the same values."""
    whole = [medium(block(1.0, 16), 0.02)]
    halves = [medium(voxels(np.ones((8, 16, 16)), (8 * k, 0, 0)), 0.02) for k in range(2)]
    for camera in (along((1, 0, 0), (8, 7, 8)), along((0, 0, 1), (7.5, 7, 8), half=0.25)):
        for smoke in (whole, halves):
            check(seen(smoke, camera), passes(0.32))


@pytest.mark.parametrize("count", [8, 9, 12])
def test_many_instances(count: int) -> None:
    """Few instances are tested one by one, and more of them by a hierarchy: a row of clouds, each with its share."""
    places = [translation(20.0 * k, 0, 0) for k in range(count)]
    smoke = [medium(block(), 0.2 / 8 / count, matrices=places)]
    check(seen(smoke, along((1, 0, 0), (10.0 * count, 3.5, 3.5), distance=20.0 * count)), passes(0.2))
    on_top = [medium(block(), 0.2 / 8 / count, matrices=[np.eye(4)] * count)]
    check(seen(on_top, spp=256), passes(0.2), tolerance=3 * TOLERANCE)


def test_the_hierarchy_does_not_show() -> None:
    """A ninth instance far from the others, which makes the difference, changes no bit."""
    rng = np.random.default_rng(2)
    places = [translation(*rng.uniform(-6, 6, 3)) @ rotation(rng.normal(size=3), 50) for _ in range(8)]
    cloud, camera = voxels(rng.random((8, 8, 8))), along((1, 0, 0), (0, 0, 0), half=15)
    few, many = (
        [medium(cloud, 0.1, 0.8, anisotropy=0.5, matrices=m)] for m in (places, [*places, translation(0, 0, -1e4)])
    )  # fmt: skip
    np.testing.assert_array_equal(seen(few, camera, 16), seen(many, camera, 16))


def test_thousands_of_instances() -> None:
    places = [translation(12.0 * x, 12.0 * y, 12.0 * z) for x in range(20) for y in range(25) for z in range(20)]
    smoke = [medium(block(), 0.05 / 160, matrices=places)]
    check(seen(smoke, along((1, 0, 0), (120, 147.5, 123.5), distance=200), 300), passes(0.05))


@pytest.mark.parametrize("turned", [False, True], ids=["one-place", "turned"])
def test_hundreds_that_overlap(turned: bool) -> None:
    """More than one traversal of the hierarchy finds. Where rays begin within all, the order is that of the instances."""
    places = [rotation((1, 0, 0), 0.5 * k) if turned else np.eye(4) for k in range(150)]
    cloud = voxels(np.ones((8, 8, 8)), (-4, -4, -4))
    check(seen([medium(cloud, 0.2 / 8 / 150, matrices=places)], along((1, 0, 0), (0, 0, 0)), 32), passes(0.2), 0.01)
    ball = glow(cloud, 1 / 150, matrices=places)
    inside = orthographic(look_at((-0.5, 0, 0), (1, 0, 0)), 0.5, clipping_range=(0.0, 100.0))
    scene = describe(volume_emissions=[ball], camera=inside, resolution=SIZE)
    check(picture(scene, 4), 4.0, 0.004)
    wide, narrow = (render(scene.build(), 4, splits=1, lanes=lanes).pixels() for lanes in (0, 4))
    np.testing.assert_array_equal(wide, narrow)


def test_extreme_densities() -> None:
    dense = seen([medium(block(), 1e6)], spp=16)
    assert dense.max() == 0.0
    thin = seen([medium(block(), 1e-9)], spp=16)
    np.testing.assert_allclose(thin, 1.0, atol=1e-6)
    check(seen([medium(block(1e-9), 0.04e9)]), passes(0.32))
    check(seen([medium(block(1e9), 0.04e-9)]), passes(0.32))


def test_grids_without_values_change_nothing() -> None:
    empty = grid_of(np.zeros((0, 3)), np.zeros((0, 512), np.float32))
    zeros = grid_of([(0, 0, 0)], np.zeros((1, 512), np.float32))
    plain = seen([], spp=4)
    for smoke in ([medium(empty)], [medium(zeros)], [medium(block(), 0.0)], [medium(block(), matrices=[])]):
        np.testing.assert_array_equal(seen(smoke, spp=4), plain)
    scene = describe(lights=[SKY], volume_emissions=[glow(empty), glow(zeros), glow(block(), 0.0)], resolution=SIZE)
    np.testing.assert_array_equal(picture(scene, 4), 1.0)


@pytest.mark.parametrize("direction", [(1, 0.02, 0.03), (0.6, 0.5, 0.55), (-0.1, -0.9, 0.3)])
def test_a_checker_of_leaves(direction: tuple[float, float, float]) -> None:
    """Leaves of 0 and 1 in turn: where a majorant misses what interpolation reaches, too much light passes."""
    grid = voxels(np.kron(np.indices((6, 6, 6)).sum(axis=0) % 2, np.ones((8, 8, 8))), (-24, -24, -24))
    d = np.array(direction) / np.linalg.norm(direction)
    through = np.array((0.3, 0.6, -0.2))
    depth = depth_along(grid, through - 60 * d, d, 120.0)
    check(seen([medium(grid, 0.3 / depth)], along(direction, through, half=1e-4)), passes(0.3))


def test_a_perspective_picture() -> None:
    """Each pixel sees exp of minus its own chord through a slab."""
    grid = voxels(np.ones((8, 120, 120)), (0, -60, -60))
    camera = perspective(look_at((-20, 0, 0), (0, 0, 0)), 0.5)
    pixels = seen([medium(grid, 0.05)], camera, 1024)
    u = (np.arange(32) + 0.5) / 32 - 0.5
    chord = np.sqrt(1 + u[:, None] ** 2 + u[None] ** 2)
    error = pixels[..., 0] / passes(0.4 * chord) - 1
    assert abs(error.mean()) < TOLERANCE
    assert np.abs(error).max() < 5 * math.sqrt(0.5 / 2048) + 0.002
