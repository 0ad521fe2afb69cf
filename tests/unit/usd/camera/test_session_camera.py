"""A camera of the session layer: an author's lens, somewhere else, and nothing else of the stage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd
from tests.unit.conftest import make_camera

import primray
from primray import usd
from primray.camera import Camera, Projection
from primray.render.prepare import open_once

STAGE = """#usda 1.0
def Xform "rig" {
    double xformOp:rotateX = 30
    uniform token[] xformOpOrder = ["xformOp:rotateX"]
    def Camera "cam" {
        float focalLength = 85
        float horizontalAperture = 30
        float fStop = 4
        float focusDistance = 6
        float2 clippingRange = (0.5, 500)
        float exposure = 1
        def Sphere "on_camera" {}
    }
    def Camera "flat" {
        token projection = "orthographic"
        float horizontalAperture = 200
        float verticalAperture = 100
    }
}
def Sphere "s" {}
"""
PLACE = np.array([[0.0, 0, 1, 5], [0, 1, 0, 2], [-1, 0, 0, 3], [0, 0, 0, 1]])


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    (tmp_path / "s.usda").write_text(STAGE)
    return open_once(str(tmp_path / "s.usda"), primray.RenderSettings()).stage


def seen(stage: Usd.Stage, camera: str) -> tuple[Camera, list[str]]:
    description, _ = usd.translate(stage, primray.RenderSettings(camera=camera, resolution=(40, 20)))
    return description.camera, sorted(shape.path for shape in description.shapes)


def test_the_authors_lens_elsewhere(stage: Usd.Stage) -> None:
    authored, shapes = seen(stage, "/rig/cam")
    placed = usd.place_camera(stage, PLACE, authored)
    camera, others = seen(stage, placed)
    assert np.allclose(camera.world_from_camera, PLACE)
    for name in ("window", "lens_radius", "focus_distance", "clipping_range", "exposure_scale", "projection"):
        assert getattr(camera, name) == getattr(authored, name), name
    assert others == shapes  # what hangs on the camera is there once
    usd.place_camera(stage, np.eye(4), authored)
    assert np.allclose(seen(stage, placed)[0].world_from_camera, np.eye(4))


def test_another_lens(stage: Usd.Stage) -> None:
    usd.place_camera(stage, PLACE, seen(stage, "/rig/cam")[0])
    flat = seen(stage, "/rig/flat")[0]
    placed = usd.place_camera(stage, PLACE, flat, 0.5)
    camera = seen(stage, placed)[0]
    assert camera.projection is Projection.ORTHOGRAPHIC
    assert np.allclose(camera.window, [0.5 * side for side in flat.window])
    usd.place_camera(stage, PLACE, flat)
    assert np.allclose(seen(stage, placed)[0].window, flat.window)


@pytest.mark.parametrize("projection", list(Projection))
def test_a_camera_that_was_made(stage: Usd.Stage, projection: Projection) -> None:
    made = make_camera(path="", projection=projection, window=(-0.6, 0.4, -0.2, 0.3), clipping_range=(0.0, 3e38))
    camera = seen(stage, usd.place_camera(stage, PLACE, made, 2.0))[0]
    assert np.allclose(camera.world_from_camera, PLACE)
    assert np.allclose(camera.window, [2 * side for side in made.window], atol=1e-6)
    assert camera.clipping_range[0] == 0
    assert camera.clipping_range[1] > 1e38


def test_files_and_lists_do_not_know_it(stage: Usd.Stage) -> None:
    usd.place_camera(stage, PLACE, seen(stage, "/rig/cam")[0])
    assert not stage.GetRootLayer().GetPrimAtPath("/primray_view")
    assert [path for path in usd.camera_paths(stage) if not usd.is_session_camera(path)] == ["/rig/cam", "/rig/flat"]


def test_inside_a_mask(tmp_path: Path) -> None:
    (tmp_path / "m.usda").write_text(STAGE)
    stage = open_once(str(tmp_path / "m.usda"), primray.RenderSettings(mask=("/rig", "/s"))).stage
    camera, shapes = seen(stage, usd.place_camera(stage, PLACE, seen(stage, "/rig/cam")[0]))
    assert np.allclose(camera.world_from_camera, PLACE)
    assert shapes == ["/rig/cam/on_camera", "/s"]
