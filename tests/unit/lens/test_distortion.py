"""Distortion of lenses: film positions of directions and back, by model and by table, against published formulas."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.images.lens.lenses import EQUIDISTANT, LENSES, K, camera_with, film_grid, inverse

from primray.camera import camera_as_json, camera_of
from primray.description import Camera, Doubles
from primray.lens.distortion import DirectionTable, Distortion, DistortionModel


def table_of(distortion: Distortion, half: float, size: int) -> Distortion:
    """The same as a table, by the core's directions at its texels."""
    at = ((np.arange(size) + 0.5) / size * 2 - 1) * half
    film = np.stack(np.meshgrid(at, -at), axis=-1).reshape(-1, 2)
    directions = inverse(distortion, film)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    texels = directions.reshape(size, size, 3).astype(np.float32)
    return Distortion(DistortionModel.TABLE, (), 180.0, DirectionTable((-half, half, -half, half), texels))


@pytest.mark.parametrize("name", LENSES)
def test_forwards_and_back_is_where_it_began(name: str) -> None:
    lens, film = LENSES[name], film_grid()
    directions = inverse(lens, film)
    seen = np.isfinite(directions).all(axis=1)
    assert seen.sum() > 400
    assert np.abs(lens.project(directions[seen]) - film[seen]).max() < 1e-9


@pytest.mark.parametrize("name", LENSES)
def test_what_is_not_seen_is_nowhere_on_the_film(name: str) -> None:
    """Every direction that the lens projects into the film is where its inverse looks, and no film point else is seen."""
    lens = LENSES[name]
    rng = np.random.default_rng(3)
    d = rng.normal(size=(20_000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    film = lens.project(d)
    lands = np.isfinite(film).all(axis=1)
    back = inverse(lens, film[lands])
    back /= np.linalg.norm(back, axis=1, keepdims=True)
    assert np.abs(back - d[lands]).max() < 1e-7  # next to where a lens turns back double roots are half as exact
    assert lands.any()
    assert lands.all() == (name == "fisheye")  # which sees all around


def test_a_table_is_its_lens() -> None:
    lens = LENSES["fisheye"]
    table, film = table_of(lens, 1.5, 257), film_grid(1.2)
    found, exact = inverse(table, film), inverse(lens, film)
    assert np.abs(found - exact).max() < 2e-5  # linear over a texel: its square by 8, and by the curvature
    assert np.abs(table.project(found) - film).max() < 1e-9


def test_texels_without_a_direction_are_not_seen() -> None:
    table = table_of(EQUIDISTANT, 1.5, 64)
    assert table.table is not None
    directions = table.table.directions.copy()
    directions[:, 32:] = np.nan
    half = replace(table, table=DirectionTable(table.table.window, directions))
    film = film_grid(1.2)
    seen = np.isfinite(inverse(half, film)).all(axis=1)
    np.testing.assert_array_equal(seen, film[:, 0] < -0.5 * 3.0 / 64)


def opencv() -> Any:
    return pytest.importorskip("cv2", reason="skipped: no OpenCV")


def points() -> Doubles:
    rng = np.random.default_rng(5)
    p = np.stack([rng.uniform(-1, 1, 2000), rng.uniform(-0.7, 0.7, 2000), -np.ones(2000)], axis=1)
    return np.asarray(p * rng.uniform(1, 9, (2000, 1)))


def intrinsics() -> tuple[Camera, Doubles]:
    """A camera of 180 and 170 pixels of focal length, and OpenCV's matrix of it."""
    fx, fy, cx, cy = 180.0, 170.0, 150.0, 110.0
    window = (-cx / fx, (320 - cx) / fx, (cy - 200) / fy, cy / fy)
    return replace(camera_with(None), window=window), np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def test_opencv_pinhole() -> None:
    cv2 = opencv()
    camera, matrix = intrinsics()
    camera = replace(camera, distortion=LENSES["rational"])
    exact = cv2.projectPoints(points() * [1, -1, -1], np.zeros(3), np.zeros(3), matrix, np.array(K))[0][:, 0]
    assert np.abs(camera.project(points(), (320, 200)) - exact).max() < 1e-9


def test_opencv_fisheye() -> None:
    cv2 = opencv()
    camera, matrix = intrinsics()
    k = np.array(LENSES["fisheye"].coefficients[1:])
    camera = replace(camera, distortion=LENSES["fisheye"])
    p = (points() * [1, -1, -1])[:, None]
    exact = cv2.fisheye.projectPoints(p, np.zeros(3), np.zeros(3), matrix, k)[0][:, 0]
    assert np.abs(camera.project(points(), (320, 200)) - exact).max() < 1e-9


def test_json_keeps_a_lens() -> None:
    for lens in (*LENSES.values(), table_of(EQUIDISTANT, 1.2, 8)):
        camera = camera_with(lens)
        again = camera_of(camera_as_json(camera))
        assert again == camera
        assert again.distortion is not None
        assert again != camera_with(None)
    old = {k: v for k, v in camera_as_json(camera_with(None)).items() if k != "distortion"}
    assert camera_of(old) == camera_with(None)
