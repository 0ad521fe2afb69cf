"""Panoramas against closed forms: equirectangular pictures of one eye or two, and the faces of cubes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.described import kernels, look_at
from tests.images.lens.lenses import inverse, scene_of

import primray
from primray import Camera
from primray.camera import camera_as_json, camera_of
from primray.core.single_precision import rebasing_origin
from primray.description import Doubles
from primray.errors import SettingsError
from primray.lens.distortion import CUBE_FACES

VIEW = look_at([3.0, -2.0, 5.0], [0.1, 0.3, -0.2])
EYES = 0.064
WRONG: Any = "globe"
CAMERAS = {
    "lat-long": Camera.lat_long(VIEW),
    "half": Camera.lat_long(VIEW, span_deg=(180.0, 180.0)),
    "stereo": Camera.lat_long(VIEW, eye_distance=EYES),
    "stereo side by side": Camera.lat_long(VIEW, eye_distance=EYES, side_by_side=True),
    "stereo half side by side": Camera.lat_long(VIEW, span_deg=(180.0, 180.0), eye_distance=EYES, side_by_side=True),
    **{f"cube of {columns}": Camera.cube(VIEW, columns=columns) for columns in (1, 2, 3, 6)},
}


def directions() -> Doubles:
    d = np.random.default_rng(5).normal(size=(2000, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def test_lat_long_is_by_its_formula() -> None:
    d = directions()
    u, v = 0.5 + np.arctan2(d[:, 0], -d[:, 2]) / (2 * np.pi), 0.5 - np.arcsin(d[:, 1]) / np.pi
    np.testing.assert_allclose(Camera.lat_long().project(d * 7, (400, 200)), np.stack([400 * u, 200 * v], axis=1), atol=1e-9)
    lens = Camera.lat_long().distortion
    assert lens is not None
    film = np.stack([(u - 0.5) * 2 * np.pi, (0.5 - v) * np.pi], axis=1)
    np.testing.assert_allclose(inverse(lens, film), d, atol=1e-14)


@pytest.mark.parametrize("columns", [1, 2, 3, 6])
def test_faces_of_a_cube_are_pinholes(columns: int) -> None:
    camera = Camera.cube(VIEW, columns=columns)
    d = directions() @ VIEW[:3, :3].T
    at = camera.project(VIEW[:3, 3] + 3 * d, (100 * columns, 600 // columns))
    seen = 0
    for k, name in enumerate(CUBE_FACES):
        on_face = camera.cube_face(name).project(VIEW[:3, 3] + 3 * d, (100, 100))
        inside = ((on_face > 0) & (on_face < 100)).all(axis=1)
        np.testing.assert_allclose(at[inside], on_face[inside] + 100.0 * np.array([k % columns, k // columns]), atol=1e-9)
        seen += int(inside.sum())
    assert seen == len(d)


def test_faces_are_those_of_openexr() -> None:
    """Ahead of each face is its axis; from one face to the next the picture goes on (ImfEnvmap's orientation)."""
    for name in CUBE_FACES:
        ahead = -Camera.cube().cube_face(name).world_from_camera[:3, 2]
        assert ahead["XYZ".index(name[1])] == (1.0 if name[0] == "+" else -1.0)
        assert np.linalg.det(Camera.cube().cube_face(name).world_from_camera) == pytest.approx(1.0)
    up = Camera.cube().cube_face("+Y")
    np.testing.assert_allclose(up.project([[0.0, 1.0, -1.0]], (10, 10)), [[5.0, 10.0]])  # its lower edge is that of -Z


@pytest.mark.parametrize("name", CAMERAS)
def test_rays_go_where_points_project(name: str) -> None:
    camera, resolution = CAMERAS[name], (96, 96)
    rng = np.random.default_rng(1)
    pixel = rng.integers(0, 96, (4000, 2)).astype(np.int32)
    film = rng.random((4000, 2), dtype=np.float32)
    o, d, _, far = kernels().camera_rays(scene_of(camera, resolution), pixel, film, np.full((4000, 2), 0.5, np.float32))
    assert (far >= 0).all()
    start = o.astype(np.float64) + rebasing_origin(camera)
    asked = pixel + film
    for distance in (0.5, 20.0):
        p = start + distance * d.astype(np.float64)
        at = np.stack([camera.project(p, resolution), camera.project(p, resolution, right_eye=True)], axis=1)
        off = np.abs(at - asked[:, None])
        off[..., 0] = np.minimum(off[..., 0], 96 - off[..., 0])  # around the back
        if "stereo" in name:
            of_right = (asked[:, 0] if "side" in name else asked[:, 1]) >= 48
            chosen = off[np.arange(len(off)), of_right.astype(int)]
            crosses = np.abs((asked[:, 0] if "side" in name else asked[:, 1]) - 48) < 0.5  # a border of the two
            poles = np.abs(p - VIEW[:3, 3]) @ np.abs(VIEW[:3, 1]) > 0.9999 * np.linalg.norm(p - VIEW[:3, 3], axis=1)
            assert chosen[~crosses & ~poles].max() < 2e-2
        else:
            assert off[:, 0].max() < 2e-2


def test_two_eyes_see_a_near_point_apart() -> None:
    """A point at a distance r ahead is 2 asin(distance of the eyes / 2 r) apart, seen from a circle of that diameter."""
    camera, resolution = Camera.lat_long(eye_distance=EYES), (3600, 3600)
    for angle, r in ((0.0, 0.5), (0.7, 2.0), (-2.0, 30.0)):
        p = [[r * np.sin(angle), 0.0, -r * np.cos(angle)]]
        left, right = camera.project(p, resolution)[0], camera.project(p, resolution, right_eye=True)[0]
        apart = np.radians((left[0] - right[0]) / 10)
        assert apart == pytest.approx(2 * np.arcsin(EYES / 2 / r), rel=1e-9)
        assert (left[1], right[1]) == (pytest.approx(900), pytest.approx(2700))
    up = np.array([camera.project([[0.0, 5.0, -1e-9]], resolution, right_eye=eye)[0] for eye in (False, True)])
    np.testing.assert_allclose(up[:, 1], [0.0, 1800.0], atol=1e-3)  # no disparity at the pole


def stage_of(path: Path, camera: str = "") -> str:
    """A stage lit by a dome with a smooth picture, and the picture's texels."""
    rows, columns = np.mgrid[0:32, 0:64]
    texels = np.stack([columns / 64, rows / 32, 0.5 + 0.5 * np.cos(columns * np.pi / 32)], axis=-1).astype(np.float32)
    picture = oiio.ImageBuf(oiio.ImageSpec(64, 32, 3, "float"))
    picture.set_pixels(picture.roi, texels)
    picture.write(str(path / "sky.exr"))
    text = f"""#usda 1.0
( upAxis = "Y"
  metersPerUnit = 1 )
def DomeLight "sky" {{ asset inputs:texture:file = @sky.exr@
    token inputs:texture:format = "latlong"
}}
def Camera "eye" {{ {camera}
}}
"""
    (path / "s.usda").write_text(text)
    return str(path / "s.usda")


def test_a_lat_long_picture_of_a_dome_is_its_texture(tmp_path: Path) -> None:
    """UsdLux turns the middle of a dome's picture to where the camera at the origin looks, as OpenEXR's +Z it has behind."""
    stage = stage_of(tmp_path)
    image = primray.render(stage, panorama="lat-long", resolution=(64, 0), spp=64)
    assert image.resolution == (64, 32)
    texels = np.asarray(oiio.ImageBuf(str(tmp_path / "sky.exr")).get_pixels(oiio.FLOAT))
    shifts = [np.abs(np.roll(image.pixels[2:-2, :, :3], n, axis=1)[:, 2:-2] - texels[2:-2, 2:-2]).max() for n in (0, 32)]
    assert min(shifts) < 0.02


def test_a_cube_of_a_dome_is_six_pinholes(tmp_path: Path) -> None:
    stage = stage_of(tmp_path)
    image = primray.render(stage, panorama="cube", resolution=(16, 0), spp=64)
    assert image.resolution == (16, 96)
    assert image.camera is not None
    for k, name in enumerate(CUBE_FACES):
        face = primray.render(stage, camera=image.camera.cube_face(name), resolution=(16, 16), spp=64)
        np.testing.assert_allclose(image.pixels[16 * k : 16 * (k + 1)], face.pixels, atol=0.03)


def test_panoramas_keep_the_place_of_the_camera_and_say_so(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, 'double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = ["xformOp:translate"]')
    for name, size in (
        ("stereo", (32, 32)),
        ("stereo-180-side-by-side", (32, 16)),
        ("cube-3", (32, 21)),
        ("lat-long-180", (32, 32)),
    ):
        image = primray.render(stage, panorama=primray.Panorama(name), resolution=(32, 0), spp=1)
        assert image.resolution == size
        assert image.camera is not None
        assert image.camera.is_panorama
        assert image.camera.world_from_camera[:3, 3].tolist() == [1.0, 2.0, 3.0]
        assert camera_of(camera_as_json(image.camera)) == image.camera
        assert image.report["settings"]["panorama"] == name
        with pytest.raises(SettingsError, match="no intrinsic matrix"):
            image.camera.intrinsics(size)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: Camera.lat_long(span_deg=(400.0, 180.0)), "a span is up to 360 by 180"),
        (lambda: Camera.lat_long(eye_distance=-1.0), "an eye distance 0 or more"),
        (lambda: Camera.cube(columns=4), "1, 2, 3 or 6 columns, not 4"),
        (lambda: Camera.cube().cube_face("up"), "has the faces"),
        (lambda: primray.RenderSettings(panorama=WRONG), "panorama"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        make()
