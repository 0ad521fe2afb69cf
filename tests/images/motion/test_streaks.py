"""What moves is seen for as long as it covers: coverage in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.described import Described, describe, orthographic, rotation, translation
from tests.images.motion.motion_scenes import (
    EYE,
    GLOW,
    alone,
    box_average,
    deforming,
    exposed,
    instanced,
    moving,
    profile,
    square,
)

from primray.description import CameraMotion


def trapezoid(x: np.ndarray, start: float = -2.0, end: float = 2.0, half: float = 1.0) -> np.ndarray:
    """How long a square of that half-width covers x on its way from `start` to `end`."""
    first, last = np.clip((x - half - start) / (end - start), 0, 1), np.clip((x + half - start) / (end - start), 0, 1)
    return last - first


def by_matrix() -> Described:
    return instanced(square(), moving([translation(-2, 0, 0), translation(2, 0, 0)]))


def by_matrix_that_turns() -> Described:
    return instanced(square(), moving([translation(-2, 0, 0), translation(2, 0, 0)], turns=True))


def by_points() -> Described:
    points = square().points
    return alone(deforming(square(), [points - [2, 0, 0], points + [2, 0, 0]]))


def by_points_at_unequal_times() -> Described:
    points = square().points
    return alone(deforming(square(), [points - [2, 0, 0], points - [1.2, 0, 0], points + [2, 0, 0]], [0, 0.2, 1]))


def by_camera() -> Described:
    scene = describe([(square(), np.eye(4))], [GLOW], camera=orthographic(EYE, 0.25, 16), resolution=(64, 4))
    camera = scene.description.camera
    poses = tuple(replace(camera, world_from_camera=translation(x, 0, 10)) for x in (2, 0.8, -2))
    return exposed(scene, camera=CameraMotion(np.array([0, 0.3, 1]), poses))


@pytest.mark.parametrize("make", [by_matrix, by_matrix_that_turns, by_points, by_points_at_unequal_times, by_camera])
def test_one_streak_whatever_moves(make: Callable[[], Described]) -> None:
    np.testing.assert_allclose(profile(make()), box_average(trapezoid), atol=0.004)


def test_a_part_of_the_span() -> None:
    scene = by_matrix()
    exposure = scene.description.exposure
    assert exposure is not None
    half = exposed(scene, replace(exposure, opens=0.25, closes=0.75))
    np.testing.assert_allclose(profile(half), box_average(lambda x: trapezoid(x, -1, 1)), atol=0.004)


def test_accelerating_by_unequal_segments() -> None:
    """p = 4 t^2 - 2: an edge passes x at t = sqrt((x + 2) / 4)."""
    times = np.linspace(0, 1, 65) ** 1.2
    scene = instanced(square(), moving([translation(4 * t * t - 2, 0, 0) for t in times], times.tolist()))

    def covered(x: np.ndarray) -> np.ndarray:
        at = lambda edge: np.sqrt(np.clip((x - edge + 2) / 4, 0, 1))  # noqa: E731
        return at(-1) - at(1)

    np.testing.assert_allclose(profile(scene), box_average(covered), atol=0.006)


@pytest.mark.parametrize("degrees", [90.0, 170.0])
def test_a_half_plane_that_turns(degrees: float) -> None:
    """Coverage is linear in the angle: half a plane turning about its edge."""
    size = 40.0
    half = replace(square(), points=(square().points + [0, 1, 0]).astype(np.float32) * size)
    scene = instanced(half, moving([rotation([0, 0, 1], a) for a in (0, degrees)], turns=True), resolution=(32, 32), half=2.0)
    from tests.described import render

    found = render(scene.build(), 1024).pixels()[..., 3]
    x, y = np.meshgrid((np.arange(32) + 0.5) / 8 - 2, 2 - (np.arange(32) + 0.5) / 8)
    angle = np.degrees(np.arctan2(y, x)) % 360
    # Covered while the edge's angle a is within 180 degrees behind.
    a = np.linspace(0, degrees, 4001)
    expected = np.mean((angle[..., None] - a) % 360 < 180, axis=-1)
    inner = np.hypot(x, y) > 0.5
    np.testing.assert_allclose(found[inner], expected[inner], atol=0.03)
    assert abs(found.mean() - expected.mean()) < 0.002


def test_everything_alike_is_a_still() -> None:
    scene = by_matrix()
    camera = scene.description.camera
    poses = tuple(replace(camera, world_from_camera=translation(x, 0, 10)) for x in (-2, 2))
    assert scene.description.exposure is not None
    still = exposed(scene, scene.description.exposure, CameraMotion(np.array([0.0, 1.0]), poses))
    np.testing.assert_allclose(profile(still, 256), box_average(lambda x: (np.abs(x) < 1) * 1.0), atol=0.002)


def test_a_camera_that_turns_three_times() -> None:
    """All the world passes by as often: a bright quarter of it is seen a quarter of the time, everywhere."""
    wall = square(1.0, -1.0)  # a quarter of a cube's inside
    from tests.described import perspective, render

    scene = describe([(wall, np.eye(4))], [GLOW], camera=perspective(np.eye(4), 0.05, 16), resolution=(64, 4))
    camera = scene.description.camera
    poses = tuple(replace(camera, world_from_camera=rotation([0, 1, 0], a)) for a in np.linspace(0, 1080, 13))
    turning = exposed(scene, camera=CameraMotion(np.linspace(0, 1, 13), poses))
    found = render(turning.build(), 4096).pixels()[..., 3]
    np.testing.assert_allclose(found.mean(axis=0), 0.25, atol=0.004)


def test_a_size_that_vanishes() -> None:
    """Scaled from 0 to 2: x is covered once the half-width has passed it."""
    from tests.described import scaling

    scene = instanced(square(), moving([scaling(0, 0, 0), scaling(2, 2, 2)]))
    y = np.linspace(-0.25, 0.25, 65)[:, None]  # of the picture's rows
    expected = box_average(lambda x: np.clip(1 - np.maximum(np.abs(x), np.abs(y)) / 2, 0, 1).mean(axis=0))
    np.testing.assert_allclose(profile(scene), expected, atol=0.004)
