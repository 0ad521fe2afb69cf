"""Volumes that move while the shutter is open: against closed forms, and against many still scenes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import (
    Described,
    describe,
    ground,
    lambert,
    light,
    look_at,
    orthographic,
    perspective,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.images.motion.motion_scenes import EVEN, box_average, exposed
from tests.images.motion.volume_scenes import emission, grid_of, medium, path_of, trapezoid, with_volumes

from primray.core.native import module
from primray.description import Exposure, LightType, VelocityBlur

SKY = light(LightType.DOME, emission=1.0)
EYE = translation(0, 0, 30)
BLOCK = np.ones((8, 8, 8))
CENTERED = translation(-3.5, -3.5, -3.5)
AXIS, ANGLES = [0, 0.3, 1], (-60, 10, 80)


def strip(half: float = 16.0, columns: int = 64, **more: Any) -> Described:
    """A row of pixels in front of a white sky."""
    camera = orthographic(EYE, half * 4 / columns, columns / 4)
    return exposed(describe([], [], [SKY], camera, (columns, 4), **more))


def standard_errors(found: Any) -> tuple[np.ndarray, float]:
    """Means of the columns, and the typical standard error of one."""
    a, b = replicate_means(found)[..., 0].mean(axis=1)
    return (a + b) / 2, float(np.sqrt(np.mean(((a - b) / 2) ** 2)))


def swept(x: np.ndarray, shift: float, depth: float = 2.0, count: int = 4000) -> np.ndarray:
    """Mean transmittance at x of a block of 8 voxels around 0 that moves by `shift` from -shift / 2."""
    times = (np.arange(count) + 0.5) / count
    return np.mean([np.exp(-depth * trapezoid(x - shift * (t - 0.5), -3.5, 3.5)) for t in times], axis=0)


@pytest.mark.parametrize("half", [False, True])
def test_a_block_sweeps_over_a_line(half: bool) -> None:
    first, last = (translation(x, 0, 0) @ CENTERED for x in (-6, 6))
    grid = grid_of(BLOCK, half=half)
    scene = with_volumes(strip(), [medium(grid, [first], motion=path_of([first, last]))])
    found, error = standard_errors(render(scene.build(), 512))
    wanted = box_average(lambda x: swept(x, 12.0, count=400), 64, 16.0, 8)
    assert error < 0.01
    np.testing.assert_allclose(found, wanted, atol=5 * error)
    assert np.abs(found - wanted).mean() < 1.5 * error


def test_far_voxels_and_uneven_times() -> None:
    """The grid is far from the origin of its index space, and half of the way takes a tenth of the time."""
    place = translation(-100003.5, -3.5, -3.5)
    steps = [translation(x, 0, 0) @ place for x in (-6, 0, 6)]
    grid = grid_of(BLOCK, (100000, 0, 0))
    scene = with_volumes(strip(), [medium(grid, steps[:1], motion=path_of(steps, (0, 0.1, 1)))])
    found, error = standard_errors(render(scene.build(), 512))

    def wanted(x: np.ndarray) -> np.ndarray:
        return 0.1 * swept(x + 3, 6.0, count=400) + 0.9 * swept(x - 3, 6.0, count=400)

    np.testing.assert_allclose(found, box_average(wanted, 64, 16.0, 8), atol=5 * error)


@pytest.mark.parametrize("many", [False, True])
def test_the_mean_of_many_still_scenes(many: bool) -> None:
    """A cloud turns about a distant axis, and scatters; beside it are enough others for a hierarchy of boxes."""
    cloud = grid_of(np.random.default_rng(5).random((16, 8, 8)) ** 2)
    pivot = translation(0, -6, 0)
    poses = [pivot @ rotation(AXIS, a) @ translation(-8, 2, -3.5) for a in ANGLES]
    others = [translation(x, -12, -4) @ scaling(0.4, 0.4, 0.4) for x in range(-14, 16, 3)] if many else []
    path = path_of(poses, turns=True)
    base = exposed(describe([], [], [SKY, light(LightType.DISTANT, rotation([1, 0, 0], -50), 3.0)],
                            orthographic(EYE, 16.0), (16, 16)))  # fmt: skip
    still = [medium(cloud, others, 0.5, 0.9)] if others else []
    moving = medium(cloud, poses[:1], 0.3, 0.9, motion=path)
    mean, error = blocks(render(with_volumes(base, [moving, *still]).build(), 1024, max_depth=4, splits=1))

    count, total, variance = 24, np.zeros((4, 4)), 0.0
    alone = replace(base, description=replace(base.description, exposure=None))
    for k in range(count):
        at = posed(poses, (k + 0.5) / count)
        one = with_volumes(alone, [medium(cloud, [at], 0.3, 0.9), *still]).build()
        a, b = blocks(render(one, 64, seed=k, max_depth=4, splits=1))
        total, variance = total + a / count, variance + b**2 / count**2
    both = np.sqrt(variance + error**2)
    assert both < 0.02
    np.testing.assert_allclose(mean, total, atol=5 * both)


def posed(poses: list[np.ndarray], time: float) -> np.ndarray:
    """The matrix between the poses of ANGLES, which are evenly spaced in time: turns are even, translations are linear."""
    k, u = (0, 2 * time) if time < 0.5 else (1, 2 * time - 1)
    matrix = rotation(AXIS, (1 - u) * ANGLES[k] + u * ANGLES[k + 1])
    matrix[:3, 3] = (1 - u) * poses[k][:3, 3] + u * poses[k + 1][:3, 3]
    return matrix


def blocks(found: Any) -> tuple[np.ndarray, float]:
    """Means of blocks of 4 x 4 pixels, and the typical standard error of one."""
    a, b = (m.mean(axis=2).reshape(4, 4, 4, 4).mean(axis=(1, 3)) for m in replicate_means(found))
    return (a + b) / 2, float(np.sqrt(np.mean(((a - b) / 2) ** 2)))


def test_fire_flies_over_a_floor_and_grows() -> None:
    """Its determinant changes, by which points on it are chosen."""
    grid = grid_of(BLOCK)
    first = translation(-3, 1.5, 0) @ scaling(0.05, 0.05, 0.05) @ CENTERED
    last = translation(2, 0.8, 0.5) @ scaling(0.12, 0.2, 0.1) @ CENTERED
    base = exposed(describe([(ground(0.2), np.eye(4))], [lambert(0.5)], [],
                            orthographic(look_at([0, 5, 0], [0, 0, 0], [0, 0, -1]), 0.05), (2, 2)))  # fmt: skip
    # The camera looks down from between the fire and the floor, so that no emission is in front of it.
    base = replace(base, description=replace(base.description, camera=orthographic(
        look_at([0, 0.3, 0], [0, 0, 0], [0, 0, -1]), 0.05)))  # fmt: skip
    scene = with_volumes(base, [], [emission(grid, [first], 2.0, motion=path_of([first, last]))])
    a, b = (m[..., 0].mean() for m in replicate_means(render(scene.build(), 8192, max_depth=1)))

    # Quadrature over time and the interpolated block.
    axis = np.arange(-1, 8, 0.25) + 0.125
    weight = trapezoid(axis, 0, 7)
    density = weight[:, None, None] * weight[:, None] * weight
    voxels = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    wanted, count = 0.0, 200
    for k in range(count):
        t = (k + 0.5) / count
        m = (1 - t) * first + t * last
        p = voxels @ m[:3, :3].T + m[:3, 3]
        r2 = (p**2).sum(axis=1)
        per_area = 2.0 * density.ravel() * p[:, 1] / r2**1.5 * 0.25**3 * np.linalg.det(m[:3, :3])
        wanted += 0.5 / np.pi * per_area.sum() / count
    assert abs(a - b) < 0.05 * wanted
    assert (a + b) / 2 == pytest.approx(wanted, rel=0.02)


def everything() -> Described:
    """Media and emission that turn and shift, in front of a floor, a sky and a lamp."""
    cloud = grid_of(np.random.default_rng(1).random((16, 16, 8)), half=True)
    small = scaling(0.1, 0.1, 0.1)
    spin = [translation(-1, 1, 0) @ rotation([1, 1, 0], a) @ small for a in (0, 80, 160)]
    rise = [translation(1, 0.5, 0) @ small, translation(1, 1.5, 0.5) @ small @ scaling(1, 1.5, 1)]
    base = describe([(ground(3.0), np.eye(4))], [lambert(0.5)],
                    [light(LightType.SPHERE, translation(0, 3, 1), 20.0, radius=0.2), light(LightType.DOME, emission=0.3)],
                    perspective(look_at([0, 2, 8], [0, 1, 0]), 0.3), (24, 24))  # fmt: skip
    media = [
        medium(cloud, spin[:1], 4.0, 0.9, motion=path_of(spin, (0, 0.3, 1), turns=True)),
        medium(cloud, rise[1:], 3.0, 0.5),
    ]
    glow = [emission(cloud, rise[:1], 2.0, motion=path_of(rise))]
    return with_volumes(exposed(base, replace(EVEN, opens=0.2, closes=0.9)), media, glow)


def test_lanes_and_threads() -> None:
    built = everything().build()
    assert built.has_moving_volumes
    first = render(built, 16, lanes=1)
    assert first.pixels()[..., :3].mean() > 0.05
    for lanes, threads in ((4, 1), (8, 2), (16, 3)):
        if lanes <= module().MAX_LANES:
            again = render(built, 16, lanes=lanes, threads=threads)
            np.testing.assert_array_equal(first.pixels(), again.pixels(), err_msg=f"{lanes} lanes, {threads} threads")


def test_motion_without_a_way_is_as_none() -> None:
    """Matrices that stay the same give the same bits as a still volume, up to what times add."""
    place = translation(0.3, 0.1, 0) @ CENTERED
    grid = grid_of(BLOCK)
    still = with_volumes(strip(), [medium(grid, [place])])
    stays = with_volumes(strip(), [medium(grid, [place], motion=path_of([place, place]))])
    np.testing.assert_array_equal(render(still.build(), 64).pixels(), render(stays.build(), 64).pixels())


def test_an_instant_of_the_shutter() -> None:
    first, last = (translation(x, 0, 0) @ CENTERED for x in (-6, 6))
    grid = grid_of(BLOCK)
    scene = with_volumes(strip(), [medium(grid, [first], motion=path_of([first, last]))])
    instant = exposed(scene, Exposure(0.75, 0.75, (0.0, 1.0)))
    found, error = standard_errors(render(instant.build(), 256))
    wanted = box_average(lambda x: np.exp(-2.0 * trapezoid(x - 3.0, -3.5, 3.5)), 64, 16.0, 8)
    np.testing.assert_allclose(found, wanted, atol=5 * error)


def blown(shift: Any, half: bool = False) -> VelocityBlur:
    """The blur by one velocity of a block of 8 voxels, in a grid that is as wide as its way."""
    velocity = np.broadcast_to(np.asarray(shift, np.float32), (40, 40, 40, 3))
    return VelocityBlur(velocity=grid_of(velocity, (-16, -16, -16), half), frame=0.5)


@pytest.mark.parametrize("half", [False, True])
def test_one_velocity_is_as_a_block_that_sweeps_over_a_line(half: bool) -> None:
    blurred = medium(grid_of(BLOCK, half=half), [CENTERED], blur=blown((12, 0, 0), half))
    found, error = standard_errors(render(with_volumes(strip(), [blurred]).build(), 512))
    wanted = box_average(lambda x: swept(x, 12.0, count=400), 64, 16.0, 8)
    assert error < 0.01
    np.testing.assert_allclose(found, wanted, atol=5 * error)
    assert np.abs(found - wanted).mean() < 1.5 * error


def test_one_velocity_is_as_a_motion() -> None:
    """Scattering, colours of voxels that go with the density, emission and its light on a floor."""
    random = np.random.default_rng(9)
    grid, colors = grid_of(random.random((8, 8, 8))), grid_of(random.random((8, 8, 8, 3)))
    place, shift = translation(-0.4, 0.6, -0.4) @ scaling(0.1, 0.1, 0.1), np.array([10.0, 4.0, -3.0])
    ends = [place @ translation(*(part * shift)) for part in (-0.5, 0.5)]
    base = exposed(describe([(ground(4.0), np.eye(4))], [lambert(0.6)],
                            [light(LightType.DISTANT, rotation([1, 0, 0], -50), 3.0)],
                            perspective(look_at([0, 2, 6], [0, 0.8, 0]), 0.3), (16, 16)))  # fmt: skip
    found = []
    for how in ({"motion": path_of(ends)}, {"blur": blown(shift)}):
        smoke = medium(grid, [place], 4.0, 1.0, albedo_grid=colors, **how)
        scene = with_volumes(base, [smoke], [emission(grid, [place], 1.5, **how)])
        found.append(blocks(render(scene.build(), 1024, max_depth=4, splits=1)))
    (a, error_a), (b, error_b) = found
    both = np.hypot(error_a, error_b)
    assert both < 0.03 * a.mean()
    np.testing.assert_allclose(a, b, atol=5 * both)


def test_lanes_and_threads_of_blurred_volumes() -> None:
    random = np.random.default_rng(3)
    scene = everything()
    d = scene.description
    wind = VelocityBlur(velocity=grid_of(random.normal(size=(32, 32, 16, 3)) * 4, (-8, -8, -8)), frame=-0.2)
    media = [replace(m, blur=wind) for m in d.media]
    built = with_volumes(scene, media, [replace(e, blur=wind) for e in d.volume_emissions]).build()
    first = render(built, 16, lanes=1)
    for lanes, threads in ((4, 1), (8, 2), (16, 3)):
        if lanes <= module().MAX_LANES:
            again = render(built, 16, lanes=lanes, threads=threads)
            np.testing.assert_array_equal(first.pixels(), again.pixels(), err_msg=f"{lanes} lanes, {threads} threads")


def test_a_shutter_that_is_open_for_an_instant_displaces_all_alike() -> None:
    blurred = medium(grid_of(BLOCK), [CENTERED], blur=blown((12, 0, 0)))
    instant = exposed(with_volumes(strip(), [blurred]), Exposure(0.75, 0.75, (0.0, 1.0)))
    found, error = standard_errors(render(instant.build(), 256))
    wanted = box_average(lambda x: np.exp(-2.0 * trapezoid(x - 3.0, -3.5, 3.5)), 64, 16.0, 8)
    np.testing.assert_allclose(found, wanted, atol=5 * error)
