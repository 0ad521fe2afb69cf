"""The light of stages without lights: its brightness, which way it shines, and that no camera sees it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import UsdGeom

import primray
from primray.arrays import Doubles
from primray.description import Light
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.lights.default_light import HEIGHT, WHITE

from ..usd_text import stage_of

WHITE_BALL = """
def Camera "c"
{{
    float focalLength = 60
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    {exposure}
}}
def Sphere "ball"
{{
    color3f[] primvars:displayColor = [(0.8, 0.8, 0.8)]
}}
"""
DIMMED = "float exposure:time = 0.001\nfloat exposure:iso = 200"


def studio_of(text: str, up: str = "Y") -> tuple[Light, Doubles]:
    """The light, and the matrix (3, 3) of the camera that looks."""
    stage = stage_of(text)
    UsdGeom.SetStageUpAxis(stage, up)
    description, _ = translate(stage, RenderSettings())
    (light,) = description.lights
    return light, description.camera.world_from_camera[:3, :3]


def directions(light: Light) -> tuple[Doubles, Doubles]:
    """(N, 3) towards each texel in the world, and their solid angles: s = 0.5 - atan2(x, z) / 2 pi, +Y above."""
    v, u = np.meshgrid((np.arange(HEIGHT) + 0.5) / HEIGHT, (np.arange(2 * HEIGHT) + 0.5) / (2 * HEIGHT), indexing="ij")
    polar, around = math.pi * v, (0.5 - u) * 2 * math.pi
    local = np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], axis=-1)
    solid_angles = np.sin(polar) * (math.pi / HEIGHT) ** 2
    return local.reshape(-1, 3) @ light.world_from_light[:3, :3].T, solid_angles.ravel()


def irradiance(light: Light, normal: Doubles) -> float:
    assert light.image is not None
    towards, solid_angles = directions(light)
    radiance = light.emission[0] * light.image[..., 0].ravel()
    return float((radiance * np.clip(towards @ normal, 0, None) * solid_angles).sum())


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_white_that_faces_the_key_light(up: str) -> None:
    """It stands on the camera's left, above and behind it; what faces away or down has less light."""
    light, world_from_camera = studio_of(WHITE_BALL.format(exposure=""), up)
    assert not light.visible_to_camera
    towards, _ = directions(light)
    assert light.image is not None
    brightest = light.image[..., 0].ravel() > 0.9 * light.image.max()
    key = towards[brightest].mean(axis=0) / np.linalg.norm(towards[brightest].mean(axis=0))
    right, above, back = world_from_camera.T @ key
    assert right < -0.2
    assert above > 0.3
    assert back > 0.5
    up_axis = np.eye(3)["XYZ".index(up)]
    assert irradiance(light, key) / math.pi == pytest.approx(WHITE, rel=0.02)
    assert irradiance(light, -up_axis) < 0.4 * irradiance(light, up_axis)
    assert irradiance(light, -key) < 0.4 * math.pi * WHITE


def test_the_cameras_exposure_makes_no_difference() -> None:
    plain, dimmed = (studio_of(WHITE_BALL.format(exposure=e))[0].emission[0] for e in ("", DIMMED))
    assert dimmed == pytest.approx(plain / 0.002)


@pytest.mark.parametrize("exposure", ["", DIMMED])
def test_white_shows_near_the_top_of_the_view_before_nothing(exposure: str) -> None:
    shown = primray.render(stage_of(WHITE_BALL.format(exposure=exposure)), resolution=(64, 48), spp=16).to_uint8()
    covered = shown[..., 3] > 0
    assert 0.3 < covered.mean() < 0.7
    assert (shown[~covered] == 0).all()
    assert 215 < np.percentile(shown[covered][:, :3], 90) < 250
