"""Cameras that no prim is: the one of a picture gives that picture again, bit for bit, and a matrix stands where it says."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom

import primray
from primray import RenderSettings
from primray.errors import CheckpointError

SCENES = Path(__file__).resolve().parents[3] / "scenes/features"
CAMERAS = ["camera-lens", "camera-offset", "camera-orthographic", "camera-clipping", "camera-exposure", "light-point"]
SMALL: dict[str, Any] = {"resolution": (32, 18), "spp": 2}
# The default lens, of a camera that is turned, moved, and looks at a sphere.
STAGE = """#usda 1.0
def Sphere "ball" {
    color3f[] primvars:displayColor = [(0.8, 0.2, 0.1)]
}
def Camera "eye" {
    double3 xformOp:translate = (1, 2, 9)
    double xformOp:rotateX = -12
    double xformOp:rotateY = 7
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY", "xformOp:rotateX"]
    float2 clippingRange = (0.001, 1000000)
}
"""


def stage() -> Usd.Stage:
    made = Usd.Stage.CreateInMemory()
    made.GetRootLayer().ImportFromString(STAGE)
    return made


@pytest.mark.parametrize("name", CAMERAS)
def test_an_images_camera_gives_its_bits_again(name: str) -> None:
    path = SCENES / name / "scene.usda"
    image = primray.render(path, **SMALL)
    again = primray.render(path, camera=image.camera, **SMALL)
    assert again.report["pixels_sha256"] == image.report["pixels_sha256"]
    assert again.camera == dataclasses.replace(image.camera, path="")  # type: ignore[type-var]


def test_a_matrix_stands_where_a_prim_would() -> None:
    made = stage()
    by_path = primray.render(made, camera="/eye", **SMALL)
    gf = UsdGeom.XformCache().GetLocalToWorldTransform(made.GetPrimAtPath("/eye"))
    for matrix in (np.array(gf).T, gf, np.array(gf).T.tolist()):
        found = primray.render(made, camera=matrix, **SMALL)
        assert found.camera is not None
        assert by_path.camera is not None
        assert np.allclose(found.camera.world_from_camera, by_path.camera.world_from_camera, atol=1e-12)
        assert np.allclose(found.camera.window, by_path.camera.window, atol=1e-12)
        assert np.allclose(found.pixels, by_path.pixels, atol=1e-3)


def test_right_up_and_backward_are_the_columns() -> None:
    """A ball to the right of and above the axis is in the picture's upper right."""
    made = stage()
    matrix = np.eye(4)
    matrix[:3, 3] = (-1, -0.7, 12)
    image = primray.render(made, camera=matrix, resolution=(40, 30), spp=4)
    rows, columns = np.nonzero(image.pixels[..., 3] > 0.5)
    assert columns.min() > 18
    assert rows.max() < 18
    assert image.camera is not None
    x, y = image.camera.project([[0, 0, 0]], image.resolution)[0]
    assert abs(x - columns.mean()) < 1
    assert abs(y - rows.mean()) < 1


def test_its_window_is_conformed_and_the_height_follows_it() -> None:
    path = SCENES / "camera-offset/scene.usda"
    camera = primray.render(path, **SMALL).camera
    assert camera is not None
    square = primray.render(path, camera=camera, resolution=(20, 20), spp=1).camera
    assert square is not None
    left, right, bottom, top = square.window
    assert (right - left) == pytest.approx(top - bottom)
    assert (left + right, bottom + top) == pytest.approx(
        (camera.window[0] + camera.window[1], camera.window[2] + camera.window[3])
    )
    assert primray.render(path, camera=camera, resolution=(64, 0), spp=1).resolution == (64, 36)


def test_the_report_says_which_and_repeats_it() -> None:
    from primray.settings import settings_of_json

    path = SCENES / "camera-lens/scene.usda"
    image = primray.render(path, camera=primray.render(path, **SMALL).camera, **SMALL)
    settings = settings_of_json(image.report["settings"])
    assert settings.camera == image.camera or dataclasses.replace(settings.camera, path="") == image.camera  # type: ignore[type-var]
    assert primray.render(path, settings).report["pixels_sha256"] == image.report["pixels_sha256"]
    assert not [d for d in image.report["diagnostics"] if d["code"].startswith("camera")]


def test_checkpoints_know_it(tmp_path: Path) -> None:
    path = SCENES / "camera-lens/scene.usda"
    saved = primray.Checkpointing(tmp_path / "a.prc")
    first = RenderSettings(camera=np.eye(4), **SMALL)
    primray.render(path, first, checkpointing=saved)
    again = primray.Checkpointing(tmp_path / "a.prc", resume=tmp_path / "a.prc")
    assert primray.render(path, first, spp=4, checkpointing=again).report["samples_per_pixel"] == [4, 4]
    moved = np.eye(4)
    moved[2, 3] = 1
    with pytest.raises(CheckpointError, match="camera"):
        primray.render(path, first, camera=moved, checkpointing=again)
