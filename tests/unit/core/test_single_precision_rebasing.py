"""The point that lengths are measured from: near the camera, shared by cameras close to each other, exact far away."""

from __future__ import annotations

import numpy as np
import pytest

from primray.camera import Camera, Projection
from primray.core.single_precision import CELLS, rebasing_origin

NEAR = 0.1


def camera_at(*eye: float, near: float = NEAR) -> Camera:
    matrix = np.eye(4)
    matrix[:3, 3] = eye
    return Camera("", matrix, Projection.PERSPECTIVE, (-0.5, 0.5, -0.5, 0.5), (near, 1e6))


def test_cameras_close_to_each_other_share_it() -> None:
    origins = [rebasing_origin(camera_at(0.8 + 0.01 * k, 8.1, 0.2)) for k in range(10)]
    assert len({tuple(origin) for origin in origins}) == 1


@pytest.mark.parametrize("world", [0.0, 1e3, 1e8])
@pytest.mark.parametrize("near", [1e-5, 0.1, 0.125, 3.0, 1e4])
def test_it_is_near_the_camera(world: float, near: float) -> None:
    eye = np.array([world + 0.37, world + 7.1, world - 0.21])
    assert np.abs(rebasing_origin(camera_at(*eye, near=near)) - eye).max() <= CELLS / 2 * near


def test_a_grid_point_is_exact() -> None:
    origin = rebasing_origin(camera_at(1e8 + 0.3, 12.7, -1e8 - 0.9))
    assert (origin == np.round(origin * 2) / 2).all()


@pytest.mark.parametrize("near", [0.0, -1.0, np.inf, np.nan])
def test_a_camera_without_a_near_plane_is_its_own(near: float) -> None:
    assert tuple(rebasing_origin(camera_at(0.123, 0.456, 0.789, near=near))) == (0.123, 0.456, 0.789)


def test_nowhere_stays_nowhere() -> None:
    assert np.isnan(rebasing_origin(camera_at(np.nan, 0.0, 0.0))[0])
