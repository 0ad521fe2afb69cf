"""`cameraSettings` of customLayerData: what an authoring tool's viewport showed comes before the automatic camera."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Usd

from primray.description import Camera, Projection
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

EYES = 'def Camera "first"\n{\n}\ndef Xform "rig"\n{\n    def Camera "eye"\n    {\n        float focalLength = 33\n    }\n}\n'
PERSPECTIVE = "dictionary Perspective = {\ndouble3 position = (10, 20, 30)\ndouble3 target = (10, 0, 30.5)\n}\n"
TOP = "dictionary Top = {\ndouble3 position = (3, 500, 4)\ndouble radius = 5\n}\n"
RIGHT = "dictionary Right = {\ndouble3 position = (-500, 1, 2)\ndouble radius = 5\n}\n"
BOX = 'def Cube "box"\n{\n}\n'


def layer(settings: str, body: str = BOX, up: str = "Y") -> Usd.Stage:
    data = f"customLayerData = {{\ndictionary cameraSettings = {{\n{settings}}}\n}}\n"
    stage = stage_of(f'#usda 1.0\n(\nupAxis = "{up}"\n{data})\n{body}')
    assert stage.GetPrimAtPath("/box") or stage.GetPrimAtPath("/first")
    return stage


def looked(stage: Usd.Stage, settings: RenderSettings | None = None) -> tuple[Camera, dict[str, str]]:
    """The camera, and what is said of its choice."""
    description, found = translate(stage, settings or RenderSettings())
    return description.camera, {d.code: f"{d.prim_path} {d.message}" for d in found if "camera" in d.code or "stage" in d.code}


def bound(path: str) -> str:
    return f'string boundCamera = "{path}"\n'


def test_a_bound_camera_of_the_stage_comes_before_its_first() -> None:
    camera, said = looked(layer(bound("/rig/eye"), EYES))
    assert camera.path == "/rig/eye"
    assert list(said) == ["camera-viewport"]
    assert said["camera-viewport"].startswith("/rig/eye ")


def test_whoever_names_a_camera_comes_before_the_viewport() -> None:
    stage = layer(bound("/rig/eye"), EYES)
    assert looked(stage, RenderSettings(camera="/first"))[0].path == "/first"
    ordered = 'def RenderSettings "s"\n{\n    rel camera = </first>\n}\n'
    assert looked(layer(bound("/rig/eye"), EYES + ordered))[0].path == "/first"
    assert looked(stage, RenderSettings(auto_camera="usdrecord"))[0].path == "/first"


def test_cameras_of_the_stage_come_before_the_tools_own() -> None:
    camera, said = looked(layer(bound("/OmniverseKit_Persp") + PERSPECTIVE, EYES))
    assert camera.path == "/first"
    assert list(said) == ["camera-chosen"]


@pytest.mark.parametrize("which", ["", bound("/OmniverseKit_Persp")])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_perspective_looks_from_its_position_to_its_target(which: str, up: str) -> None:
    camera, said = looked(layer(which + PERSPECTIVE, up=up))
    assert list(said) == ["camera-viewport"]
    m = camera.world_from_camera
    np.testing.assert_allclose(m[:3, 3], (10, 20, 30))
    np.testing.assert_allclose(-m[:3, 2], np.array([0, -20, 0.5]) / math.hypot(20, 0.5))
    assert m[1 if up == "Y" else 2, 0] == pytest.approx(0)  # level
    assert m[1 if up == "Y" else 2, 1] > 0
    assert np.linalg.det(m) == pytest.approx(1)
    left, right, bottom, top = camera.window
    assert math.degrees(math.atan(right)) * 2 == pytest.approx(60, abs=0.1)  # Kit's
    assert (right - left) / (top - bottom) == pytest.approx(960 / 701)
    assert looked(layer(which + PERSPECTIVE, up=up), RenderSettings(auto_camera="usdrecord"))[1].keys() == {"camera-automatic"}


def test_straight_down() -> None:
    camera, _ = looked(layer(PERSPECTIVE.replace("30.5", "30")))
    np.testing.assert_allclose(camera.world_from_camera[:3, :3], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)


def test_orthographic_views() -> None:
    camera, said = looked(layer(bound("/OmniverseKit_Top") + TOP), RenderSettings(resolution=(100, 100)))
    assert camera.projection is Projection.ORTHOGRAPHIC
    np.testing.assert_allclose(camera.world_from_camera[:3], [[1, 0, 0, 3], [0, 0, 1, 500], [0, -1, 0, 4]], atol=1e-12)
    assert camera.window[:2] == pytest.approx((-5, 5))
    assert "Top" in said["camera-viewport"]
    camera, _ = looked(layer(bound("/OmniverseKit_Right") + RIGHT))
    np.testing.assert_allclose(camera.world_from_camera[:3, 2], (-1, 0, 0))  # from the side that it stands on
    camera, _ = looked(layer(bound("/OmniverseKit_Right") + RIGHT.replace("(-500, 1, 2)", "(0, -500, 2)"), up="Z"))
    np.testing.assert_allclose(camera.world_from_camera[:3, :3], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)


@pytest.mark.parametrize(
    "settings",
    [
        PERSPECTIVE.replace("(10, 0, 30.5)", "(10, 20, 30)"),
        PERSPECTIVE.replace("(10, 0, 30.5)", "(nan, 0, 1)"),
        PERSPECTIVE.replace("(10, 0, 30.5)", "(inf, 0, 1)"),
        PERSPECTIVE.replace("double3 target = (10, 0, 30.5)", 'string target = "abc"'),
        PERSPECTIVE.replace("double3 target = (10, 0, 30.5)", "double[] target = [1, 2]"),
        PERSPECTIVE.replace("double3 target = (10, 0, 30.5)", "double2 target = (1, 2)"),
        "dictionary Perspective = {\n}\n",
        "string Perspective = 'behind'\n",
        PERSPECTIVE + "int boundCamera = 3\n",
        bound("/OmniverseKit_Top") + TOP.replace("radius = 5", "radius = -5"),
        bound("/OmniverseKit_Top") + TOP.replace("radius = 5", "radius = nan"),
        bound("/OmniverseKit_Top") + TOP.replace("double radius = 5", 'string radius = "5"'),
    ],
)
def test_what_is_of_no_use_is_told_and_the_automatic_camera_looks(settings: str) -> None:
    camera, said = looked(layer(settings))
    assert set(said) == {"stage-metadata", "camera-automatic"}
    assert camera == looked(stage_of(BOX))[0]


def test_settings_that_are_no_dictionary() -> None:
    stage = stage_of(f'#usda 1.0\n(\ncustomLayerData = {{\nstring cameraSettings = "x"\n}}\n)\n{BOX}')
    assert set(looked(stage)[1]) == {"stage-metadata", "camera-automatic"}


@pytest.mark.parametrize("path", ["/gone", "/box", "", "a b", "relative"])
def test_a_bound_camera_that_is_none_is_told(path: str) -> None:
    camera, said = looked(layer(bound(path) + PERSPECTIVE))
    assert set(said) == {"camera-viewport", "camera-automatic"}
    assert camera == looked(stage_of(BOX))[0]


@pytest.mark.parametrize("settings", ["", bound("/OmniverseKit_Front") + TOP])
def test_where_nothing_is_remembered_nothing_is_said(settings: str) -> None:
    assert set(looked(layer(settings))[1]) == {"camera-automatic"}


def test_the_session_layer_is_stronger() -> None:
    stage = layer(bound("/rig/eye"), EYES)
    stage.GetSessionLayer().customLayerData = {"cameraSettings": {"boundCamera": "/first"}}
    assert looked(stage)[0].path == "/first"
