"""Emission of each light type, by UsdLux's formulas worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import UsdLux

from primray.description import Light, LightType
from primray.settings import RenderSettings
from primray.usd.lights.light import distant_size_factor

from ..usd_text import translate_text


def light(body: str, kind: str = "SphereLight") -> Light:
    description, _ = translate_text(f'def {kind} "light"\n{{\n{body}\n}}\n')
    (only,) = description.lights
    return only


def codes(body: str, kind: str) -> list[str]:
    description, found = translate_text(f'def {kind} "light"\n{{\n{body}\n}}\n', RenderSettings(default_light=False))
    assert description.lights == ()
    return [code for code, path in found if path == "/light"]


def test_default_distant_light_gives_a_white_wall_1_07() -> None:
    sun = light("", "DistantLight")
    assert sun.emission == (50000, 50000, 50000)
    theta = math.radians(sun.angle_deg) / 2
    assert sun.emission[0] * math.sin(theta) ** 2 == pytest.approx(1.0695, rel=1e-3)  # E / pi


def test_distant_size_factor() -> None:
    assert distant_size_factor(0) == 1
    assert distant_size_factor(90) == pytest.approx(math.pi / 2)
    assert distant_size_factor(180) == pytest.approx(math.pi)
    assert distant_size_factor(270) == pytest.approx(math.pi * 1.5)
    assert distant_size_factor(360) == pytest.approx(2 * math.pi)
    assert light("float inputs:angle = 60\nbool inputs:normalize = 1\nfloat inputs:intensity = 2", "DistantLight").emission[
        0
    ] == (pytest.approx(2 / (math.pi * 0.25)))
    assert light("float inputs:angle = 0\nfloat inputs:intensity = 3", "DistantLight").emission == (3, 3, 3)


def test_exposure_color_and_temperature_multiply() -> None:
    tint = UsdLux.BlackbodyTemperatureAsRgb(3000)
    found = light(
        "float inputs:exposure = 3\nfloat inputs:intensity = 0.5\ncolor3f inputs:color = (1, 0.5, 0.25)\n"
        "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 3000"
    )
    assert found.emission == pytest.approx((4 * tint[0], 2 * tint[1], tint[2]), rel=1e-6)


def test_temperature_alone_does_nothing() -> None:
    assert light("float inputs:colorTemperature = 3000").emission == (1, 1, 1)


def test_normalize_divides_by_the_world_area() -> None:
    scaled = 'float3 xformOp:scale = (2, 2, 2)\nuniform token[] xformOpOrder = ["xformOp:scale"]\nbool inputs:normalize = 1'
    assert light(scaled).emission[0] == pytest.approx(1 / (4 * math.pi))
    assert light(scaled, "RectLight").emission[0] == pytest.approx(1 / 4)
    assert light(scaled, "DiskLight").emission[0] == pytest.approx(1 / math.pi)
    assert light(scaled, "CylinderLight").emission[0] == pytest.approx(1 / (4 * math.pi))
    assert light(scaled, "DomeLight").emission[0] == 1


@pytest.mark.conforms("SphereLight.treatAsPoint")
def test_point_light_of_intensity_ten() -> None:
    point = light("bool treatAsPoint = 1\nbool inputs:normalize = 1\nfloat inputs:intensity = 40\nfloat inputs:radius = 7")
    assert point.type is LightType.POINT
    assert point.emission == (10, 10, 10)
    bare = light("bool treatAsPoint = 1\nfloat inputs:intensity = 40\nfloat inputs:radius = 0.5")
    assert bare.emission[0] == pytest.approx(40 * math.pi * 0.25)


def test_sphere_of_radius_zero() -> None:
    assert light("float inputs:radius = 0\nbool inputs:normalize = 1").type is LightType.POINT
    assert codes("float inputs:radius = 0", "SphereLight") == ["light-dark"]
    assert codes("float inputs:width = 0", "RectLight") == ["light-dark"]
    # The limit of what is normalized: as bright, and too small to be told from a line.
    line = light("float inputs:width = 0\nfloat inputs:height = 2\nbool inputs:normalize = 1", "RectLight")
    assert line.width * line.height * line.emission[0] == pytest.approx(1.0)


def test_dome_1_pole_follows_the_stage() -> None:
    text = '#usda 1.0\n(\n    upAxis = "Z"\n)\ndef DomeLight_1 "dome"\n{\n}\n'
    matrix = translate_text(text)[0].lights[0].world_from_light[:3, :3]
    assert np.allclose(matrix @ (0, 1, 0), (0, 0, 1))  # the pole
    assert np.allclose(matrix @ (0, 0, 1), (0, -1, 0))  # longitude 0, the image's centre
    assert np.allclose(matrix @ (1, 0, 0), (1, 0, 0))
    plain = translate_text(text.replace("DomeLight_1", "DomeLight"))[0].lights[0]
    assert np.allclose(plain.world_from_light, np.eye(4))


def test_invisible_lights_and_other_purposes_are_out() -> None:
    assert codes('token visibility = "invisible"', "SphereLight") == []
    assert codes('uniform token purpose = "guide"', "SphereLight") == []


def test_background_dome_is_kept() -> None:
    dome = light("float inputs:diffuse = 0\nfloat inputs:specular = 0", "DomeLight")
    assert (dome.diffuse, dome.specular, dome.emission) == (0, 0, (1, 1, 1))


def test_lights_of_instances_shine_each() -> None:
    text = """over "lib"
{
    def Xform "lamp"
    {
        def SphereLight "bulb"
        {
            bool inputs:normalize = 1
        }
    }
}
def PointInstancer "lamps"
{
    rel prototypes = </lib/lamp>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(1, 0, 0), (2, 0, 0)]
    float3[] scales = [(1, 1, 1), (3, 3, 3)]
}
"""
    first, second = translate_text(text)[0].lights
    assert (first.world_from_light[0, 3], second.world_from_light[0, 3]) == (1, 2)
    assert first.emission[0] == pytest.approx(9 * second.emission[0])


def test_default_light_only_where_nothing_shines() -> None:
    assert [x.path for x in translate_text('def Sphere "s"\n{\n}\n')[0].lights] == [
        "primray:default-light",
        "primray:default-key",
    ]
    assert translate_text('def Sphere "s"\n{\n}\n', RenderSettings(default_light=False))[0].lights == ()


@pytest.mark.parametrize(("targets", "told"), [("None", False), ("[]", False), ("</f>", True)])
def test_filters_are_told_where_there_are_any(targets: str, told: bool) -> None:
    _, found = translate_text(f'def SphereLight "l"\n{{\n    rel light:filters = {targets}\n}}\n')
    assert (("light-input", "/l") in found) == told


@pytest.mark.conforms("CylinderLight.treatAsLine")
def test_a_line_is_a_thin_cylinder_of_the_same_power() -> None:
    """L 2 r across it by length; with normalize 1 / (pi length), whatever the radius."""
    body = "bool treatAsLine = 1\nfloat inputs:radius = 0.25\nfloat inputs:length = 3\nfloat inputs:intensity = 10\n"
    line = light(body, "CylinderLight")
    assert (line.type, line.length) == (LightType.LINE, 3)
    assert line.emission[0] == pytest.approx(10 * 2 * 0.25)
    assert light(body + "bool inputs:normalize = 1", "CylinderLight").emission[0] == pytest.approx(10 / (math.pi * 3))
    scaled = 'float3 xformOp:scale = (2, 3, 3)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
    assert light(body + scaled, "CylinderLight").emission[0] == pytest.approx(10 * 2 * 0.75)
    assert light(body + scaled + "bool inputs:normalize = 1", "CylinderLight").emission[0] == pytest.approx(10 / (math.pi * 6))
    assert light("float inputs:radius = 0\nbool inputs:normalize = 1", "CylinderLight").type is LightType.LINE
    assert codes("bool treatAsLine = 1\nfloat inputs:radius = 0", "CylinderLight") == ["light-dark"]
    assert light("", "CylinderLight").type is LightType.CYLINDER


def test_sizes_and_emission_in_range() -> None:
    def noted(body: str) -> set[str]:
        return {code for code, path in translate_text(f'def SphereLight "light"\n{{\n{body}\n}}\n')[1] if path == "/light"}

    assert light("float inputs:radius = -2").radius == 2
    assert noted("float inputs:radius = -2") == {"out-of-range"}
    assert light("float inputs:exposure = 1000").emission == (1e30,) * 3
    assert light("color3f inputs:color = (-1, 0.5, 2)").emission == (0.0, 0.5, 2.0)
    assert noted("float inputs:intensity = -1") == {"out-of-range"}
    hot = "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = %s"
    assert noted(hot % 20000) == {"out-of-range"}
    assert not noted(hot % 10000)
