"""The studio light of stages that glow: added where what glows lights less than half of what is seen, and as asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray
from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.staging import DARK_RADIANCE
from primray.usd import translate

CAMERA = """
def Camera "c"
{
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
GLOW = """
def Material "glow"
{
    token outputs:surface.connect = </glow/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor = %s
        token outputs:surface
    }
}
"""


def ball(name: str, radius: float, at: tuple[float, float, float], more: str = "") -> str:
    return f"""
def Sphere "{name}" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    double radius = {radius}
    double3 xformOp:translate = {at}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    {more}
}}
"""


BOUND = "rel material:binding = </glow>"
BODY = ball("body", 1, (0, 0, 0))
LED = ball("led", 0.05, (0.3, 0.3, 0.95), BOUND) + GLOW % "(0, 4, 0)"
LAMP = ball("lamp", 1, (3, 3, 4), BOUND) + GLOW % "(30, 30, 30)"
SUN = 'def DistantLight "sun"\n{\n    float inputs:intensity = 0\n}\n'


def stage_of(text: str) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(f'#usda 1.0\n(\n    upAxis = "Y"\n)\n{CAMERA}{text}')
    return stage


def rendered(text: str, **more: Any) -> primray.Image:
    return primray.render(stage_of(text), resolution=(48, 36), spp=8, **more)


def says(image: primray.Image) -> list[str]:
    return [d["message"] for d in image.report["diagnostics"] if d["code"] == "default-light"]


def body_of(image: primray.Image) -> float:
    """The median luminance of what is covered."""
    return float(np.median(image.pixels[..., 1][image.pixels[..., 3] == 1]))


def test_an_led_does_not_switch_the_studio_off() -> None:
    image, dark = rendered(BODY + LED), rendered(BODY + LED, studio_light="off")
    (message,) = says(image)
    assert "emissive surfaces light" in message
    assert says(dark) == []
    assert body_of(dark) < DARK_RADIANCE
    assert body_of(image) == pytest.approx(body_of(rendered(BODY)), rel=0.1)
    again = rendered(BODY + LED, studio_light="auto", threads=1)
    np.testing.assert_array_equal(image.pixels, again.pixels)
    other = rendered(BODY + LED, seed=5)
    assert says(other) == [message]  # the samples of the picture do not decide


def test_each_frame_of_a_sequence_is_judged_by_itself() -> None:
    weak = "{ 1: (1e-4, 0, 0), 2: (30, 30, 30), 3: (1e-4, 0, 0) }"
    blinking = LAMP.replace("emissiveColor = (30, 30, 30)", f"emissiveColor.timeSamples = {weak}")
    stage = stage_of(BODY + blinking)
    asked = [RenderSettings(resolution=(48, 36), spp=4, time_code=t) for t in (1.0, 2.0, 3.0)]
    images = list(primray.render_frames(stage, asked))
    assert [bool(says(image)) for image in images] == [True, False, True]
    for settings, image in zip(asked, images, strict=True):
        np.testing.assert_array_equal(image.pixels, primray.render(stage, settings).pixels)


@pytest.mark.parametrize("text", [BODY + LAMP, ball("star", 1, (0, 0, 0), BOUND) + GLOW % "(1, 1, 1)", BODY + LED + SUN])
def test_what_lights_the_picture_is_meant(text: str) -> None:
    """So is a light that emits nothing. The picture is the one without a studio light, bit for bit."""
    image = rendered(text)
    assert says(image) == []
    np.testing.assert_array_equal(image.pixels, rendered(text, studio_light="off").pixels)


def test_stages_with_lights_or_without_glow_are_not_judged() -> None:
    for text, open_question in ((BODY, False), (BODY + LED, True), (BODY + LED + SUN, False), (BODY + SUN, False)):
        assert translate(stage_of(text), RenderSettings())[0].may_need_light is open_question
    for asked in ("on", "off"):
        assert not translate(stage_of(BODY + LED), RenderSettings(studio_light=asked))[0].may_need_light


def test_on_adds_it_beside_the_stages_lights() -> None:
    lit = SUN.replace("intensity = 0", "intensity = 1")
    image = rendered(BODY + lit, studio_light="on")
    assert "as requested" in says(image)[0]
    assert body_of(image) == pytest.approx(body_of(rendered(BODY + lit)) + body_of(rendered(BODY)), rel=0.1)
    with pytest.raises(SettingsError, match="default_light is off"):
        RenderSettings(default_light=False, studio_light="on")
