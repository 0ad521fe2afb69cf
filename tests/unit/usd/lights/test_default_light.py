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


def studio_of(text: str, up: str = "Y") -> tuple[Light, Light, Doubles]:
    """The dome, the key light, and the matrix (3, 3) of the camera that looks."""
    stage = stage_of(text)
    UsdGeom.SetStageUpAxis(stage, up)
    description, _ = translate(stage, RenderSettings())
    dome, key = description.lights
    return dome, key, description.camera.world_from_camera[:3, :3]


def directions(light: Light) -> tuple[Doubles, Doubles]:
    """(N, 3) towards each texel in the world, and their solid angles: s = 0.5 - atan2(x, z) / 2 pi, +Y above."""
    v, u = np.meshgrid((np.arange(HEIGHT) + 0.5) / HEIGHT, (np.arange(2 * HEIGHT) + 0.5) / (2 * HEIGHT), indexing="ij")
    polar, around = math.pi * v, (0.5 - u) * 2 * math.pi
    local = np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], axis=-1)
    solid_angles = np.sin(polar) * (math.pi / HEIGHT) ** 2
    return local.reshape(-1, 3) @ light.world_from_light[:3, :3].T, solid_angles.ravel()


def irradiance(dome: Light, normal: Doubles) -> float:
    assert dome.image is not None
    towards, solid_angles = directions(dome)
    radiance = dome.emission[0] * dome.image[..., 0].ravel()
    return float((radiance * np.clip(towards @ normal, 0, None) * solid_angles).sum())


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_white_that_faces_the_camera(up: str) -> None:
    """The key light is on the camera's left, above and behind it; what faces down has less light than what faces up."""
    dome, key, world_from_camera = studio_of(WHITE_BALL.format(exposure=""), up)
    assert not dome.visible_to_camera
    assert not key.visible_to_camera
    towards = key.world_from_light[:3, 2]
    right, above, back = world_from_camera.T @ towards
    assert right < -0.2
    assert min(above, back) > 0.3
    assert np.allclose(key.world_from_light[:3, :3] @ key.world_from_light[:3, :3].T, np.eye(3))
    from_key = math.pi * key.emission[0] * math.sin(math.radians(key.angle_deg / 2)) ** 2 * back
    assert (from_key + irradiance(dome, world_from_camera[:, 2])) / math.pi == pytest.approx(WHITE, rel=0.02)
    up_axis = np.eye(3)["XYZ".index(up)]
    assert 0 < irradiance(dome, -up_axis) < 0.7 * irradiance(dome, up_axis)


def test_the_cameras_exposure_makes_no_difference() -> None:
    (dome, key, _), (dim, dim_key, _) = (studio_of(WHITE_BALL.format(exposure=e)) for e in ("", DIMMED))
    assert dim.emission[0] == pytest.approx(dome.emission[0] / 0.002)
    assert dim_key.emission[0] == pytest.approx(key.emission[0] / 0.002)


@pytest.mark.parametrize("exposure", ["", DIMMED])
def test_white_shows_below_the_top_of_the_view_before_nothing(exposure: str) -> None:
    shown = primray.render(stage_of(WHITE_BALL.format(exposure=exposure)), resolution=(64, 48), spp=16).to_uint8()
    covered = shown[..., 3] > 0
    assert 0.3 < covered.mean() < 0.7
    assert (shown[~covered] == 0).all()
    assert 190 < np.percentile(shown[covered][:, :3], 90) < 215
