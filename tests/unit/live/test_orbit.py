"""What a mouse does to a camera: it turns about what it looks at, with the stage's axis up, and finds all there is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.conftest import make_camera

from primray.camera import Camera, Projection
from primray.live.orbit import Orbit, orbit_of

BOX = (np.array([-1.0, -2.0, -3.0]), np.array([3.0, 4.0, 5.0]))
MIDDLE = np.array([1.0, 1.0, 1.0])
UPS = {False: np.array([0.0, 1.0, 0.0]), True: np.array([0.0, 0.0, 1.0])}


def looking(eye: np.ndarray, at: np.ndarray, z_up: bool, **changes: object) -> Camera:
    back = (eye - at) / np.linalg.norm(eye - at)
    right = np.cross(UPS[z_up], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :4] = np.stack([right, np.cross(back, right), back, eye], axis=1)
    return make_camera(world_from_camera=matrix, **changes)


def eye_of(orbit: Orbit) -> np.ndarray:
    return orbit.world_from_camera[:3, 3]


@pytest.mark.parametrize("z_up", [False, True])
def test_a_camera_keeps_its_place_and_looks_at_the_middle(z_up: bool) -> None:
    camera = looking(np.array([9.0, 7.0, 8.0]), MIDDLE, z_up)
    orbit = orbit_of(camera, BOX, z_up)
    assert np.allclose(orbit.world_from_camera, camera.world_from_camera)
    assert np.allclose(orbit.target, MIDDLE)


@pytest.mark.parametrize("z_up", [False, True])
@pytest.mark.parametrize(("across", "down"), [(0.25, 0.0), (0.0, 0.1), (-0.4, -0.2), (3.1, 0.02)])
def test_it_tumbles_about_its_target_and_stays_upright(z_up: bool, across: float, down: float) -> None:
    orbit = orbit_of(looking(np.array([9.0, 7.0, 8.0]), MIDDLE, z_up), BOX, z_up)
    turned = orbit.tumbled(across, down)
    assert np.allclose(turned.target, orbit.target)
    assert np.linalg.norm(eye_of(turned) - MIDDLE) == pytest.approx(np.linalg.norm(eye_of(orbit) - MIDDLE))
    assert np.allclose(turned.rotation.T @ turned.rotation, np.eye(3))
    assert np.linalg.det(turned.rotation) == pytest.approx(1)
    assert turned.rotation[:, 0] @ UPS[z_up] == pytest.approx(0, abs=1e-12)  # the horizon is level


def test_what_is_looked_at_follows_the_mouse() -> None:
    """In front of the target, to the right of it on the picture after a drag to the right; lower after one downwards."""
    orbit = orbit_of(looking(np.array([1.0, 1.0, 11.0]), MIDDLE, False), BOX, False)
    near = MIDDLE + [0, 0, 1.0]
    for turned, axis, sign in ((orbit.tumbled(0.05, 0), 0, 1), (orbit.tumbled(0, 0.05), 1, -1)):
        seen = turned.rotation.T @ (near - eye_of(turned))
        assert sign * seen[axis] > 0.1
    assert eye_of(orbit.tumbled(0, 0.05))[1] > eye_of(orbit)[1]  # from above


@pytest.mark.parametrize("down", [0.3, -0.3])
def test_it_does_not_turn_over(down: float) -> None:
    orbit = orbit_of(looking(np.array([1.0, 3.0, 11.0]), MIDDLE, False), BOX, False)
    for _ in range(10):
        orbit = orbit.tumbled(0.1, down)
        assert orbit.rotation[1, 1] > 0


def test_one_that_looks_straight_down_can_be_raised() -> None:
    matrix = np.eye(4)
    matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # looks along -Y
    matrix[:3, 3] = [1, 20, 1]
    orbit = orbit_of(make_camera(world_from_camera=matrix), BOX, False)
    assert eye_of(orbit.tumbled(0, -0.2))[1] < 19
    assert np.allclose(orbit.tumbled(0, 0.2).rotation, orbit.rotation)


def test_panning_keeps_the_point_under_the_mouse() -> None:
    camera = looking(np.array([1.0, 1.0, 11.0]), MIDDLE, False)
    orbit = orbit_of(camera, BOX, False)
    moved = replace(camera, world_from_camera=orbit.panned(0.25, 0.125, camera).world_from_camera)
    before, after = (c.project(MIDDLE, (200, 100))[0] for c in (camera, moved))
    assert np.allclose(after - before, (25, 12.5))


def test_dollying() -> None:
    camera = looking(np.array([1.0, 1.0, 11.0]), MIDDLE, False)
    assert orbit_of(camera, BOX, False).dollied(math.log(2), camera).distance == pytest.approx(5)
    flat = replace(camera, projection=Projection.ORTHOGRAPHIC, window=(-4.0, 4.0, -2.0, 2.0))
    nearer = orbit_of(flat, BOX, False).dollied(math.log(2), flat)
    assert (nearer.distance, nearer.zoom) == (pytest.approx(10), pytest.approx(0.5))


@pytest.mark.parametrize("projection", list(Projection))
def test_all_there_is_is_framed(projection: Projection) -> None:
    window = (-0.5, 0.5, -0.25, 0.25)
    camera = looking(np.array([90.0, 70.0, -80.0]), np.array([5.0, 0.0, 0.0]), False, projection=projection, window=window)
    orbit = orbit_of(camera, BOX, False).framed(BOX, camera)
    left, right, bottom, top = (orbit.zoom * side for side in window)
    framed = replace(camera, world_from_camera=orbit.world_from_camera, window=(left, right, bottom, top))
    corners = np.array(np.meshgrid(*zip(*BOX, strict=True))).reshape(3, -1).T
    at = framed.project(corners, (200, 100))
    assert (at >= 0).all()
    assert (at <= (200, 100)).all()
    assert np.ptp(at[:, 1]) > 40
    assert np.allclose(orbit.target, MIDDLE)


def test_a_camera_that_looks_away_or_at_nothing() -> None:
    away = looking(np.array([0.0, 0.0, 50.0]), np.array([0.0, 0.0, 90.0]), False)
    assert orbit_of(away, BOX, False).distance > 0
    nothing = orbit_of(replace(away, focus_distance=7.0), None, False)
    assert nothing.distance == 7


@pytest.mark.parametrize("z_up", [False, True])
def test_another_target_moves_nothing_and_is_what_it_turns_about(z_up: bool) -> None:
    """The point under the mouse stays where it is on the picture while the camera goes around it."""
    camera = looking(np.array([9.0, 7.0, 8.0]), MIDDLE, z_up)
    point = MIDDLE + [1.5, -0.5, 0.8]
    orbit = orbit_of(camera, BOX, z_up).about(point)
    assert np.array_equal(orbit.world_from_camera, orbit_of(camera, BOX, z_up).world_from_camera)
    before = np.linalg.norm(eye_of(orbit) - point)
    for across, down in ((0.2, 0.0), (0.0, 0.05), (-0.4, -0.1)):
        turned = orbit.tumbled(across, down)
        assert np.linalg.norm(eye_of(turned) - point) == pytest.approx(before)
        assert np.allclose(turned.rotation.T @ (point - turned.eye), orbit.rotation.T @ (point - orbit.eye))  # on the picture
        assert turned.rotation[:, 0] @ UPS[z_up] == pytest.approx(0, abs=1e-12)
    nearer = orbit.dollied(0.5, camera)
    seen = [replace(camera, world_from_camera=o.world_from_camera).project(point, (200, 100))[0] for o in (orbit, nearer)]
    assert np.allclose(seen[0], seen[1])  # towards the point, not towards the middle of the picture


def test_a_target_behind_the_camera_is_none() -> None:
    orbit = orbit_of(looking(np.array([1.0, 1.0, 11.0]), MIDDLE, False), BOX, False)
    assert orbit.about(np.array([1.0, 1.0, 12.0])) is orbit


def test_looking_around_leaves_the_eye() -> None:
    orbit = orbit_of(looking(np.array([1.0, 1.0, 11.0]), MIDDLE, False), BOX, False)
    turned = orbit.looking(0.1, 0.05)
    assert np.array_equal(turned.eye, orbit.eye)
    assert turned.distance == pytest.approx(orbit.distance)
    seen = turned.rotation.T @ (MIDDLE - turned.eye)
    assert seen[0] > 0.1  # what was in the middle is to the right, as the mouse is
    assert seen[1] < -0.1


def test_flying() -> None:
    orbit = orbit_of(looking(np.array([1.0, 1.0, 11.0]), MIDDLE, False), BOX, False)
    assert np.allclose(orbit.flown(0.1, 0, 0).eye, [1, 1, 10])
    assert np.allclose(orbit.flown(0, 0.1, 0.2).eye, [2, 3, 11])
    assert orbit.flown(5, 0, 0).distance == pytest.approx(10)  # as far ahead as before, even behind everything
