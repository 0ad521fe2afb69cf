"""Which lumens and lux a light asks for, and what is told where they cannot be had."""

from __future__ import annotations

import math

import pytest

from primray.color.color_space import ACESCG, luminance_weights
from primray.color.spectrum import efficacy, of_chromaticity
from primray.description import Light, LightType
from primray.settings import RenderSettings

from ..usd_text import translate_text
from .physical_text import Noted, physical

# A unit square: a lumen of it is 1 / pi nits.
AREA, DOME, DISTANT = "PhotometricAreaLightAPI", "PhotometricDomeLightAPI", "PhotometricDistantLightAPI"
OF_WHITE = efficacy(of_chromaticity((0.3127, 0.3290)))


def nits(found: tuple[Light, Noted]) -> float:
    light, noted = found
    assert noted == set()
    assert light.emission[0] == light.emission[1] == light.emission[2]
    return light.emission[0]


def rect(body: str, apis: str = "", meters: float = 1.0) -> tuple[Light, Noted]:
    return physical(body, "RectLight", apis, meters)


def test_fallbacks_count_where_the_schema_is_applied() -> None:
    assert nits(rect("", AREA)) == pytest.approx(1600 / math.pi)
    assert nits(rect("", "RadiometricAreaLightAPI")) == pytest.approx(2.34 * OF_WHITE / math.pi)
    assert nits(physical("", "DomeLight", DOME)) == pytest.approx(10000 / math.pi)
    assert nits(physical("", "DomeLight_1", "RadiometricDomeLightAPI")) == pytest.approx(14.64 * OF_WHITE / math.pi)
    assert nits(physical("float inputs:angle = 0", "DistantLight", DISTANT)) == pytest.approx(10000)
    assert nits(physical("float inputs:angle = 0", "DistantLight", "RadiometricDistantLightAPI")) == pytest.approx(
        14.64 * OF_WHITE
    )
    assert nits(rect("")) == 1


def test_attributes_count_without_the_schema() -> None:
    assert nits(rect("float photometric:power = 30")) == pytest.approx(30 / math.pi)
    assert nits(rect("double photometric:power = 30")) == pytest.approx(30 / math.pi)
    assert nits(physical("float photometric:illuminance = 30", "DomeLight")) == pytest.approx(30 / math.pi)


@pytest.mark.conforms(
    "RadiometricAreaLightAPI.radiometric:power",
    "RadiometricDomeLightAPI.radiometric:irradiance",
    "RadiometricDistantLightAPI.radiometric:irradiance",
)
def test_watts_are_lumens_of_their_spectrum() -> None:
    """205 lm/W for daylight of 6500 K between 380 and 780 nm."""
    assert pytest.approx(205, rel=2e-3) == OF_WHITE
    assert nits(rect("float radiometric:power = 2")) == pytest.approx(2 * OF_WHITE / math.pi)
    assert nits(physical("float radiometric:irradiance = 3", "DomeLight")) == pytest.approx(3 * OF_WHITE / math.pi)
    sun = physical("float radiometric:irradiance = 3\nfloat inputs:angle = 0", "DistantLight")
    assert nits(sun) == pytest.approx(3 * OF_WHITE)
    line = "token physical:illuminant = 'custom'\nfloat2[] physical:customIlluminant = [(554, 0), (555, 1), (556, 0)]\n"
    light, _ = rect(line + "float radiometric:power = 2")
    luminance = sum(w * x for w, x in zip((0.2126, 0.7152, 0.0722), light.emission, strict=True))
    assert luminance == pytest.approx(2 * 683 / math.pi, rel=1e-3)
    warm, _ = rect("bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 3000\nfloat radiometric:power = 2")
    assert max(warm.emission) < 2 * OF_WHITE  # 160 lm/W


@pytest.mark.conforms(
    "RadiometricAreaLightAPI.radiometric:irradiance", "RadiometricAreaLightAPI.radiometric:irradiance:distance"
)
def test_illuminance_ahead_needs_a_distance() -> None:
    lux, at = "float photometric:illuminance = 100\n", "float photometric:illuminance:distance = 2\n"
    ball = "float inputs:radius = 1\n"
    assert nits(physical(ball + lux + at)) == pytest.approx(400 / math.pi)
    assert nits(physical(ball + lux + at, apis=AREA)) == pytest.approx(400 / math.pi)
    assert nits(physical("float inputs:radius = 100\n" + lux + at, meters=0.01)) == pytest.approx(400 / math.pi)
    watts = "float radiometric:irradiance = 100\nfloat radiometric:irradiance:distance = 2\n"
    assert nits(physical(ball + watts)) == pytest.approx(400 * OF_WHITE / math.pi)
    light, noted = physical(lux, apis=AREA)
    assert noted == {("light-input", "photometric:illuminance")}
    assert light.emission[0] == pytest.approx(1600 / math.pi**2)
    light, noted = physical(at, apis=AREA)
    assert noted == {("light-input", "photometric:illuminance:distance")}
    assert light.emission[0] == pytest.approx(1600 / math.pi**2)
    light, noted = physical(lux)
    assert (light.emission, noted) == ((1, 1, 1), {("light-input", "photometric:illuminance")})


def test_photometric_comes_first() -> None:
    light, noted = rect("float photometric:power = 30\nfloat radiometric:power = 2")
    assert light.emission[0] == pytest.approx(30 / math.pi)
    assert noted == {("light-input", "radiometric:power")}
    light, noted = rect("float radiometric:power = 2", f"{AREA} RadiometricAreaLightAPI")
    assert light.emission[0] == pytest.approx(1600 / math.pi)
    assert noted == {("light-input", "radiometric:power")}


def test_what_scales_emission_cancels() -> None:
    others = "float inputs:intensity = 7\nfloat inputs:exposure = 5\nbool inputs:normalize = 1\nfloat inputs:diffuse = 1\n"
    for kind in ("RectLight", "SphereLight", "DiskLight", "CylinderLight"):
        with_them, plain = physical(others, kind, AREA), physical("", kind, AREA)
        assert nits(with_them) == pytest.approx(nits(plain))
    red, _ = rect("color3f inputs:color = (3, 0, 0)", AREA)
    assert red.emission == pytest.approx((1600 / math.pi / 0.2126, 0, 0))


def test_luminance_is_that_of_the_rendering_space() -> None:
    red, _ = physical("color3f inputs:color = (3, 0, 0)", "RectLight", AREA, space="lin_ap1_scene")
    assert red.emission[0] == pytest.approx(1600 / math.pi / luminance_weights(ACESCG)[0])


def test_metres_and_scale() -> None:
    for meters in (1.0, 0.01, 1000.0):
        assert nits(rect("", AREA, meters)) == pytest.approx(1600 / math.pi / meters**2)
    scaled = 'float3 xformOp:scale = (2, 3, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    assert nits(rect(scaled, AREA)) == pytest.approx(1600 / math.pi / 6)


def test_lights_without_size_are_points_and_lines() -> None:
    ball, noted = physical("float inputs:radius = 0", apis=AREA)
    assert (ball.type, noted) == (LightType.POINT, set())
    assert ball.emission[0] == pytest.approx(1600 / (4 * math.pi))
    rod, _ = physical("float inputs:radius = 0\nfloat inputs:length = 2", "CylinderLight", AREA)
    assert rod.type is LightType.LINE
    assert rod.emission[0] == pytest.approx(1600 / (math.pi**2 * 2))


@pytest.mark.parametrize(
    ("kind", "body", "expected"),
    [
        ("RectLight", "float photometric:power = 0", {("light-dark", "")}),
        ("RectLight", "float photometric:power = -1", {("out-of-range", "photometric:power"), ("light-dark", "")}),
        ("RectLight", "float photometric:power = 9\nfloat inputs:intensity = 0", {("light-dark", "")}),
        ("RectLight", "float photometric:power = 9\ncolor3f inputs:color = (0, 0, 0)", {("light-dark", "")}),
        ("RectLight", "float photometric:power = 9\nfloat inputs:shaping:cone:angle = 0",
         {("light-dark", ""), ("light-dark", "inputs:shaping:cone:angle")}),
        ("SphereLight", "float photometric:illuminance = 9\nfloat photometric:illuminance:distance = 0.4",
         {("light-dark", "")}),
    ],
)  # fmt: skip
def test_lights_that_give_nothing(kind: str, body: str, expected: Noted) -> None:
    light, noted = physical(body, kind)
    assert light.emission == (0, 0, 0)
    assert noted == expected


@pytest.mark.parametrize(
    ("kind", "body", "apis", "expected"),
    [
        ("RectLight", "float photometric:power = nan", "", {("wrong-type", "photometric:power")}),
        ("RectLight", 'string photometric:power = "bright"', "", {("wrong-type", "photometric:power")}),
        ("RectLight", "float photometric:power = 1e38", "", {("out-of-range", "")}),
        ("RectLight", "float photometric:illuminance = 1\nfloat photometric:illuminance:distance = -1", AREA,
         {("out-of-range", "photometric:illuminance:distance")}),
        ("RectLight", "", DOME, {("light-input", "")}),
        ("DomeLight", "float photometric:power = 1", "", {("light-input", "photometric:power")}),
        ("DistantLight", "float photometric:illuminance:distance = 1", DISTANT,
         {("light-input", "photometric:illuminance:distance")}),
    ],
)  # fmt: skip
def test_what_is_told(kind: str, body: str, apis: str, expected: Noted) -> None:
    assert physical(body, kind, apis)[1] == expected


@pytest.mark.conforms(
    *(f"PhysicalCameraResponsivityAPI.physical:responsivity:{channel}" for channel in "rgb"),
    *(f"PhysicalColorFilterArrayAPI.physical:colorFilterArray:{name}" for name in ("pattern", "wavelengths", "filters")),
    state="diagnosed",
)
def test_sensors_are_told() -> None:
    for schema in ("PhysicalCameraResponsivityAPI", "PhysicalColorFilterArrayAPI"):
        _, found = translate_text(f'def Camera "c" (prepend apiSchemas = ["{schema}"]) {{}}\n')
        assert ("api-schema", "/c") in found


def test_other_prims_are_told() -> None:
    text = 'def Xform "a" (prepend apiSchemas = ["PhotometricAreaLightAPI", "PhysicalLightIlluminantAPI"]) {}\n'
    text += 'def Cube "b" (prepend apiSchemas = ["LightAPI", "PhotometricAreaLightAPI"]) {\nfloat photometric:power = 9\n}\n'
    _, found = translate_text(text, RenderSettings(default_light=False))
    told = [path for code, path in found if code == "light-input"]
    assert [told.count(path) for path in ("/a", "/b")] == [2, 2]
    assert not [path for code, path in found if code == "api-schema"]


def test_lights_that_ask_for_nothing_are_as_before() -> None:
    light, noted = physical("")
    assert (light.emission, light.photometric, noted) == ((1, 1, 1), None, set())
