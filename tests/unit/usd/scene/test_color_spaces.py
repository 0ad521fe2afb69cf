"""Who says which colour space an attribute is in, and which the rendering space is; the numbers come from primaries."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd
from tests.colorimetry import D50, P3_D65, between, from_srgb
from tests.colorimetry import REC709 as PUBLISHED

from primray.color.color_space import ACESCG, REC709, ColorSpace, converted, named
from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd.scene.color_spaces import authored_space, scope_at
from primray.usd.scene.context import NO_COLOR_SCOPE, Context
from primray.usd.stage.values import when_of

from ..color_text import (
    AP1_HERE,
    APPLIED,
    DEFINED,
    FROM_AP1,
    HOUSE,
    IN_AP1,
    RGB,
    TO_AP1,
    ball,
    close,
    emitted,
    lamp,
    quiet,
    shown,
)
from ..usd_text import stage_of, translate_text


@pytest.mark.conforms("ColorSpaceAPI.colorSpace:name", "Gprim.primvars:displayColor")
def test_metadata_then_the_nearest_prim_then_rec709() -> None:
    assert shown(ball("")) == pytest.approx(RGB)
    assert close(shown(ball('(colorSpace = "lin_ap1_scene")')), FROM_AP1 @ RGB)
    assert close(shown(ball("", AP1_HERE, APPLIED + "{")), FROM_AP1 @ RGB)
    srgb = '(colorSpace = "srgb_rec709_scene")'
    assert close(shown(ball(srgb, AP1_HERE, APPLIED + "{")), from_srgb(RGB))


@pytest.mark.conforms("ColorSpaceAPI.colorSpace:name")
def test_a_name_without_the_schema_says_nothing() -> None:
    assert shown(ball("", AP1_HERE)) == pytest.approx(RGB)


@pytest.mark.conforms("ColorSpaceAPI.colorSpace:name")
@pytest.mark.parametrize("name", ["data", "raw", "unknown", "identity"])
def test_data_is_not_converted(name: str) -> None:
    assert shown(ball(f'(colorSpace = "{name}")'), IN_AP1) == pytest.approx(RGB)


def test_unknown_names_are_told_and_taken_as_rec709() -> None:
    description, found = translate_text(ball('(colorSpace = "nonsense")'), IN_AP1)
    assert ("color-space", "/top/ball") in found
    assert close(description.surfaces[0].diffuse_color, TO_AP1 @ RGB)


def test_names_that_only_the_configuration_knows() -> None:
    """ACEScct has a curve that no ColorSpaceDefinitionAPI could have: 0.4135884 is 0.18 (S-2016-001)."""
    found = shown(
        f'def Sphere "b" {{ color3f[] primvars:displayColor = [({", ".join(["0.4135884"] * 3)})] (colorSpace = "ACEScct")\n}}'
    )
    assert found == pytest.approx((0.18, 0.18, 0.18), abs=1e-5)


_DEFINITION_ROWS = [
    f"ColorSpaceDefinitionAPI.{name}"
    for name in ("name", "redChroma", "greenChroma", "blueChroma", "whitePoint", "gamma", "linearBias")
]


@pytest.mark.conforms(*_DEFINITION_ROWS)
def test_custom_spaces_are_known_where_they_are_defined_and_below() -> None:
    assert close(shown(ball("", "", DEFINED)), HOUSE)
    elsewhere = 'def Sphere "ball" { color3f[] primvars:displayColor = [(1, 0, 0)] (colorSpace = "house")\n}'
    _, found = translate_text(f'def Xform "top" {DEFINED}}}\n{elsewhere}')
    assert ("color-space", "/ball") in found


@pytest.mark.conforms(*_DEFINITION_ROWS)
@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ("redChroma = (0.64, 0.33)", lambda: between(((0.64, 0.33), *P3_D65[1:]), PUBLISHED) @ from_srgb(RGB)),
        ("greenChroma = (0.3, 0.6)", lambda: between((P3_D65[0], (0.3, 0.6), *P3_D65[2:]), PUBLISHED) @ from_srgb(RGB)),
        ("blueChroma = (0.14, 0.05)", lambda: between((*P3_D65[:2], (0.14, 0.05), P3_D65[3]), PUBLISHED) @ from_srgb(RGB)),
        ("whitePoint = (0.3457, 0.3585)", lambda: between((*P3_D65[:3], D50), PUBLISHED, adapt=False) @ from_srgb(RGB)),
        ("gamma = 1", lambda: between(P3_D65, PUBLISHED) @ RGB),
        ("linearBias = 0", lambda: between(P3_D65, PUBLISHED) @ np.power(RGB, 2.4)),
    ],
)  # fmt: skip
def test_every_number_of_a_definition(changed: str, expected) -> None:  # type: ignore[no-untyped-def]
    name = changed.split()[0]
    lines = [line for line in DEFINED.splitlines() if f":{name} =" not in line]
    kind = "float" if name in ("gamma", "linearBias") else "float2"
    made = "\n".join([*lines, f"    {kind} colorSpaceDefinition:ours:{changed}\n"])
    if name == "gamma":
        made = made.replace("linearBias = 0.055", "linearBias = 0")
    # Lights alone may be of any colour: a surface's is clamped.
    found = emitted(lamp(f"color3f inputs:color = {RGB}\nfloat inputs:intensity = 2", "", made))
    assert close(found, np.maximum(2 * expected(), 0))


@pytest.mark.conforms(*_DEFINITION_ROWS)
def test_a_definition_without_opinions_is_xyz_by_the_name_custom() -> None:
    text = (
        '(prepend apiSchemas = ["ColorSpaceAPI", "ColorSpaceDefinitionAPI:any"])\n{uniform token colorSpace:name = "custom"\n'
    )
    gf = Gf.ColorSpace("custom", Gf.Vec2f(1, 0), Gf.Vec2f(0, 1), Gf.Vec2f(0, 0), Gf.Vec2f(1 / 3, 1 / 3), 1, 0)
    expected = Gf.ColorSpace("lin_rec709_scene").Convert(gf, Gf.Vec3f(0.5, 0.5, 0.4)).GetRGB()
    assert close(emitted(lamp("color3f inputs:color = (0.5, 0.5, 0.4)\nfloat inputs:intensity = 1", "", text)), expected)


@pytest.mark.parametrize("numbers", ["redChroma = (0.15, 0.06)", "gamma = -1", "whitePoint = (0.3, 0)", "linearBias = inf"])
def test_definitions_that_define_nothing_are_told(numbers: str) -> None:
    kind = "float2" if "(" in numbers else "float"
    name = numbers.split()[0]
    lines = [line for line in DEFINED.splitlines() if f":{name} =" not in line]
    made = "\n".join([*lines, f"    {kind} colorSpaceDefinition:ours:{numbers}\n"])
    description, found = translate_text(ball("", "", made))
    assert found.count(("color-space", "/top")) == 1
    assert ("color-space", "/top/ball") in found
    assert description.surfaces[0].diffuse_color == pytest.approx(RGB)


NESTED = """
def Xform "A" (prepend apiSchemas = ["ColorSpaceAPI", "ColorSpaceDefinitionAPI:mine"])
{
    uniform token colorSpace:name = "mine"
    uniform token colorSpaceDefinition:mine:name = "mine"
    float2 colorSpaceDefinition:mine:redChroma = (0.7, 0.3)
    float2 colorSpaceDefinition:mine:greenChroma = (0.2, 0.75)
    float2 colorSpaceDefinition:mine:blueChroma = (0.14, 0.05)
    float2 colorSpaceDefinition:mine:whitePoint = (0.3127, 0.329)
    float colorSpaceDefinition:mine:gamma = 2
    def Xform "B" (prepend apiSchemas = ["ColorSpaceDefinitionAPI:other"])
    {
        uniform token colorSpaceDefinition:other:name = "mine"
        color3f c = (1, 1, 1)
        color3f d = (1, 1, 1) (colorSpace = "lin_ap1_scene")
    }
    def Xform "C"
    {
        color3f c = (1, 1, 1)
        uniform token colorSpace:name = "srgb_rec709_scene"
        def Xform "E" (prepend apiSchemas = ["ColorSpaceAPI"])
        {
            uniform token colorSpace:name = "lin_p3d65_scene"
            color3f c = (1, 1, 1)
            def Xform "F"
            {
                color3f c = (1, 1, 1)
            }
        }
    }
}
def Xform "lone"
{
    color3f c = (1, 1, 1)
}
"""


@pytest.mark.parametrize("path", ["/A/B.c", "/A/B.d", "/A/C.c", "/A/C/E.c", "/A/C/E/F.c", "/lone.c"])
def test_resolution_is_usds(path: str) -> None:
    stage = stage_of(NESTED)
    ctx = Context(stage, RenderSettings(), when_of(stage, None), (), (), Diagnostics())
    attribute = stage.GetAttributeAtPath(path)
    ours = authored_space(attribute, scope_at(attribute.GetPrim(), ctx), ctx)
    name = Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, None)
    if ours is None:
        assert name == ""
        return
    assert isinstance(ours, ColorSpace)
    assert ours.name == name
    theirs = Usd.ColorSpaceAPI.ComputeColorSpace(attribute, None)
    numbers = [tuple(corner) for corner in theirs.GetPrimariesAndWhitePoint()]
    assert close(ours.gamut, numbers)
    assert (ours.gamma, ours.bias) == pytest.approx((theirs.GetGamma(), theirs.GetLinearBias()))


def test_nothing_authored_is_no_scope() -> None:
    stage = stage_of('def Xform "a" { def Sphere "b" {\n}\n}')
    ctx = Context(stage, RenderSettings(), when_of(stage, None), (), (), Diagnostics())
    assert scope_at(stage.GetPrimAtPath("/a/b"), ctx) is NO_COLOR_SCOPE


def asking(space: str, before: str = "") -> str:
    return f'def RenderSettings "settings" {before or "{"}\nuniform token renderingColorSpace = "{space}"\n}}\n{ball("")}'


@pytest.mark.conforms("RenderSettings.renderingColorSpace")
@pytest.mark.parametrize("name", ["lin_ap1_scene", "lin_rec2020_scene", "lin_p3d65_scene", "lin_ap0_scene", "ACEScg"])
def test_render_settings_name_it(name: str) -> None:
    description = quiet(asking(name))
    wanted = named("lin_ap1_scene" if name == "ACEScg" else name)
    assert wanted is not None
    assert description.rendering_space == wanted
    assert close(description.surfaces[0].diffuse_color, converted(np.array(RGB), REC709, wanted))


@pytest.mark.conforms("RenderSettings.renderingColorSpace")
def test_the_users_wins_and_rec709_is_the_default() -> None:
    assert quiet(asking("lin_rec2020_scene"), IN_AP1).rendering_space == ACESCG
    assert quiet(ball("")).rendering_space == REC709


@pytest.mark.conforms("RenderSettings.renderingColorSpace")
@pytest.mark.parametrize("name", ["nonsense", "srgb_rec709_scene", "data", "lin_ciexyzd65_scene", "ACEScct"])
def test_what_is_no_linear_rgb_space(name: str) -> None:
    description, found = translate_text(asking(name))
    assert ("color-space", "/settings") in found
    assert description.rendering_space == REC709
    with pytest.raises(SettingsError, match=r"colour space|linear RGB"):
        translate_text(ball(""), RenderSettings(rendering_color_space=name))


@pytest.mark.conforms("RenderSettings.renderingColorSpace")
def test_a_rendering_space_of_the_stages_own() -> None:
    linear = DEFINED.replace("gamma = 2.4", "gamma = 1").replace("linearBias = 0.055", "linearBias = 0")
    description = quiet(asking("house", linear))
    assert description.rendering_space.name == "house"
    assert close(description.surfaces[0].diffuse_color, between(PUBLISHED, P3_D65) @ RGB)


def test_default_lights_and_the_fallback_grey_are_grey() -> None:
    description = quiet('def Sphere "ball" {\n}', IN_AP1)
    assert description.surfaces[0].diffuse_color == (0.18, 0.18, 0.18)
    assert all(len(set(light.emission)) == 1 for light in description.lights)
    assert description.lights[0].image is not None
    assert (np.ptp(description.lights[0].image, axis=2) == 0).all()
