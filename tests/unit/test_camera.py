"""Cameras as data: the pixels that points project to, and their JSON."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from primray.camera import Projection, camera_as_json, camera_of

from .conftest import make_camera

RESOLUTION = (200, 100)


def test_a_point_on_the_axis_is_in_the_middle() -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 2.0, 3.0
    camera = make_camera(world_from_camera=matrix)
    np.testing.assert_allclose(camera.project([[1.0, 2.0, -7.0]], RESOLUTION), [[100.0, 50.0]])


def test_the_corners_of_the_window_are_those_of_the_frame() -> None:
    camera = make_camera()
    left, right, bottom, top = camera.window
    corners = [(x, y) for y in (top, bottom) for x in (left, right)]
    expected = [(0.0, 0.0), (200.0, 0.0), (0.0, 100.0), (200.0, 100.0)]
    near_and_far = np.array([(x * z, y * z, -z) for z in (1.0, 10.0) for x, y in corners])
    np.testing.assert_allclose(camera.project(near_and_far, RESOLUTION), expected * 2, atol=1e-9)
    flat = replace(camera, projection=Projection.ORTHOGRAPHIC)
    parallel = np.array([(x, y, -z) for z in (1.0, 10.0) for x, y in corners])
    np.testing.assert_allclose(flat.project(parallel, RESOLUTION), expected * 2, atol=1e-9)


def test_points_behind_a_perspective_camera_have_no_pixel() -> None:
    assert np.isnan(make_camera().project([[0.0, 0.0, 1.0]], RESOLUTION)).all()


def test_json_keeps_a_camera() -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = 0.1, -2.0, 1e6
    camera = make_camera(
        world_from_camera=matrix,
        projection=Projection.ORTHOGRAPHIC,
        lens_radius=0.01,
        focus_distance=3.0,
        blades=5,
        clipping_planes=((0.0, 1.0, 0.0, -2.0),),
        shutter=(-0.25, 0.25),
        natural_vignetting=True,
        rim=(0.1, 0.02),
        channel_magnification=(1.001, 1.0, 0.999),
        channel_focus_shift=(0.01, 0.0, -0.01),
    )
    assert camera_of(camera_as_json(camera)) == camera


@pytest.mark.parametrize(
    "wrong",
    [
        {"world_from_camera": [[1.0, 0.0], [0.0, 1.0]]},
        {"window": [0.5, 0.5, -1.0, 1.0]},
        {"window": [-1.0, 1.0, 0.0, 0.0]},
        {"clipping_range": [1.0, 1.0]},
        {"projection": "fisheye"},
        {"lens_radius": None},
    ],
)
def test_what_is_no_camera_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises((ValueError, KeyError, TypeError)):
        camera_of(camera_as_json(make_camera()) | wrong)
