"""The point that lengths are measured from: near the camera, shared by cameras close to each other, exact far away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from primray.camera import Camera, Projection
from primray.refine.rebasing import CELL, rebasing_origin

NEAR = 0.01


def camera_at(*eye: float) -> Camera:
    matrix = np.eye(4)
    matrix[:3, 3] = eye
    return Camera("", matrix, Projection.PERSPECTIVE, (-0.5, 0.5, -0.5, 0.5), (NEAR, 1e6))


def boxes(*found: tuple[tuple[float, ...], tuple[float, ...]]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([low for low, _ in found]).reshape(-1, 3), np.array([high for _, high in found]).reshape(-1, 3)


FLOOR = boxes(((-100, -1, -100), (100, 0, 100)), ((3, 0, -2), (4, 1, -1)))


def test_cameras_close_to_each_other_share_it() -> None:
    origins = [rebasing_origin(camera_at(0.3 + 0.01 * k, 8.0, 0.2), *FLOOR) for k in range(10)]
    assert len({tuple(origin) for origin in origins}) == 1


@pytest.mark.parametrize("world", [0.0, 1e3, 1e8])
@pytest.mark.parametrize("height", [1e-3, 0.1, 3.0, 1e4])
def test_it_is_nearer_than_what_is_seen(world: float, height: float) -> None:
    low, high = (corner + world for corner in FLOOR)
    camera = camera_at(world + 0.37, world + height, world + 0.21)
    eye = camera.world_from_camera[:3, 3]
    seen_from = max(eye[1] - world, NEAR)
    assert np.abs(rebasing_origin(camera, low, high) - eye).max() <= CELL / 2 * seen_from


def test_a_grid_point_is_exact() -> None:
    origin = rebasing_origin(camera_at(1e8 + 0.3, 12.7, -1e8 - 0.9), *boxes(((1e8 + 20, 0, 0), (1e9, 1, 1))))
    assert (origin == np.round(origin * 2**10) / 2**10).all()


@pytest.mark.parametrize("low", [np.nan, np.inf, -np.inf])
def test_boxes_without_a_place_do_not_count(low: float) -> None:
    strange = boxes(((low, low, low), (np.nan, np.inf, np.nan)))
    origin = rebasing_origin(camera_at(0.123, 0.456, 0.789), *strange)
    assert np.abs(origin - (0.123, 0.456, 0.789)).max() <= NEAR


def test_nothing_to_go_by_leaves_the_camera() -> None:
    eye = (0.123, 0.456, 0.789)
    camera = replace(camera_at(*eye), clipping_range=(0.0, 1e6))
    assert tuple(rebasing_origin(camera, *boxes())) == eye
    inside = boxes(((-1, -1, -1), (1, 1, 1)))
    assert tuple(rebasing_origin(camera, *inside)) == eye
