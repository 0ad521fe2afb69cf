"""Cameras as machines give them: OpenCV's matrix and coefficients, a field of view, eye and target, OpenGL's matrices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import primray
from primray.camera import camera_as_json, camera_of
from primray.errors import SettingsError

K = np.array([[310.0, 0.0, 155.3], [0.0, 290.0, 101.9], [0.0, 0.0, 1.0]])
RESOLUTION = (320, 200)
POSE = primray.looking_at((2.0, 3.0, 4.0), (0.5, 0.2, -0.1), (0.1, 1.0, 0.0))
COEFFICIENTS = (-0.2, 0.05, 0.002, -0.003, -0.004, 0.01, 0.002, 0.001, 0.001, -0.002, 0.0015, 0.0003)


def points_before(camera: primray.Camera, spread: float = 0.35) -> Any:
    rng = np.random.default_rng(5)
    depth = rng.uniform(1.0, 9.0, 200)
    x, y = rng.uniform(-spread, spread, (2, 200)) * depth
    return np.stack([x, y, -depth], axis=1) @ camera.world_from_camera[:3, :3].T + camera.world_from_camera[:3, 3]


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_points_are_where_opencv_projects_them(count: int) -> None:
    cv2 = pytest.importorskip("cv2")
    coefficients = (*COEFFICIENTS, 0.0, 0.0)[:count]
    camera = primray.Camera.from_intrinsics(K, RESOLUTION, POSE, coefficients)
    world, pose = points_before(camera), camera.opencv_camera_from_world
    expected, _ = cv2.projectPoints(world, cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], K, np.array(coefficients))
    np.testing.assert_allclose(camera.project(world, RESOLUTION), expected[:, 0] + 0.5, atol=1e-8)


def test_a_fisheye_is_opencvs() -> None:
    cv2 = pytest.importorskip("cv2")
    k = (0.02, -0.01, 0.003, -0.0004)
    camera = primray.Camera.from_intrinsics(K, RESOLUTION, POSE, k, fisheye=True)
    world, pose = points_before(camera, 2.0), camera.opencv_camera_from_world
    expected, _ = cv2.fisheye.projectPoints(world[:, None], cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], K, np.array(k))
    np.testing.assert_allclose(camera.project(world, RESOLUTION), expected[:, 0] + 0.5, atol=1e-8)


@pytest.mark.parametrize("half_pixels", [False, True])
def test_an_intrinsic_matrix_comes_back(half_pixels: bool) -> None:
    camera = primray.Camera.from_intrinsics(K, RESOLUTION, half_pixels=half_pixels)
    np.testing.assert_allclose(camera.intrinsics(RESOLUTION, half_pixels=half_pixels), K, rtol=1e-14)
    shift = camera.intrinsics(RESOLUTION, half_pixels=True) - camera.intrinsics(RESOLUTION)
    np.testing.assert_allclose(shift, [[0.0, 0.0, 0.5], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]], atol=1e-12)
    assert camera_of(camera_as_json(camera)) == camera


@pytest.mark.parametrize("axis", ["horizontal", "vertical", "diagonal"])
def test_a_field_of_view_is_between_the_sides(axis: str) -> None:
    camera = primray.Camera.from_field_of_view(70.0, RESOLUTION, axis=axis)
    left, right, bottom, top = camera.window
    across, up = {"horizontal": (right, 0.0), "vertical": (0.0, top), "diagonal": (right, top)}[axis]
    assert 2 * np.degrees(np.arctan(np.hypot(across, up))) == pytest.approx(70.0)
    assert (right - left) / (top - bottom) == pytest.approx(RESOLUTION[0] / RESOLUTION[1])


def test_a_camera_looks_at_its_target_upright() -> None:
    camera = primray.Camera.from_field_of_view(40.0, RESOLUTION, POSE)
    np.testing.assert_allclose(camera.project([[0.5, 0.2, -0.1]], RESOLUTION), [[160.0, 100.0]])
    np.testing.assert_allclose(POSE[:3, 3], (2.0, 3.0, 4.0))
    np.testing.assert_allclose(POSE[:3, :3] @ POSE[:3, :3].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(POSE) == pytest.approx(1.0)
    above, below = camera.project([[0.5, 0.3, -0.1], [0.5, 0.1, -0.1]], RESOLUTION)
    assert above[1] < below[1]


@pytest.mark.parametrize("projection", list(primray.Projection))
def test_opengls_matrices_land_on_the_same_pixels(projection: primray.Projection) -> None:
    camera = primray.Camera.from_intrinsics(K, RESOLUTION, POSE, clipping_range=(0.5, 20.0))
    camera = replace(camera, projection=projection)
    world = points_before(camera)
    clip = np.hstack([world, np.ones((len(world), 1))]) @ (camera.opengl_projection @ camera.opengl_camera_from_world).T
    ndc = clip[:, :3] / clip[:, 3:]
    pixels = np.stack([(ndc[:, 0] + 1) / 2 * RESOLUTION[0], (1 - ndc[:, 1]) / 2 * RESOLUTION[1]], axis=1)
    np.testing.assert_allclose(pixels, camera.project(world, RESOLUTION), atol=1e-9)
    for depth, expected in ((0.5, -1.0), (20.0, 1.0)):
        at = camera.opengl_projection @ [0.0, 0.0, -depth, 1.0]
        assert at[2] / at[3] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: primray.Camera.from_intrinsics(np.eye(4), RESOLUTION), "3 x 3"),
        (
            lambda: primray.Camera.from_intrinsics([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], RESOLUTION),
            "fx and fy above 0",
        ),
        (lambda: primray.Camera.from_intrinsics([[1, 0, 0], [0, -1, 0], [0, 0, 1]], RESOLUTION), "fx and fy above 0"),
        (lambda: primray.Camera.from_intrinsics(K * np.nan, RESOLUTION), "finite"),
        (lambda: primray.Camera.from_intrinsics(K, RESOLUTION, distortion=(0.1, 0.2, 0.3)), "not 3"),
        (lambda: primray.Camera.from_intrinsics(K, RESOLUTION, distortion=(*COEFFICIENTS, 0.1, 0.0)), "tilted"),
        (lambda: primray.Camera.from_intrinsics(K, RESOLUTION, distortion=(0.1,), fisheye=True), "not 1"),
        (lambda: primray.Camera.from_field_of_view(180.0, RESOLUTION), "180"),
        (lambda: primray.Camera.from_field_of_view(50.0, RESOLUTION, axis="across"), "across"),
        (lambda: primray.looking_at((1, 2, 3), (1, 2, 3)), "apart"),
        (lambda: primray.looking_at((0, 2, 0), (0, 1, 0)), "along the view"),
    ],
)
def test_what_is_no_camera_is_said(make: Any, says: str) -> None:
    with pytest.raises(SettingsError, match=says) as caught:
        make()
    assert caught.value.where == "camera"
