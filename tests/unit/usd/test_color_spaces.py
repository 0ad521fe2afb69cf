"""Colour spaces of attributes: who says which, and the numbers in the rendering space, worked out from primaries."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from pxr import Gf, Usd, UsdLux

from primray.color_space import ACESCG, REC709, ColorSpace, converted, named
from primray.description import Mesh, PrimvarInput, SceneDescription, Sphere
from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd.color_spaces import NOWHERE, authored_space, scope_at
from primray.usd.context import Context
from primray.usd.read import when_of
from tests.colorimetry import AP1, P3_D65, between, from_srgb
from tests.colorimetry import REC709 as PUBLISHED

from .usd_text import stage_of, translate_text

TO_AP1 = between(PUBLISHED, AP1)
FROM_AP1 = between(AP1, PUBLISHED)
RGB = (0.6, 0.3, 0.2)
IN_AP1 = RenderSettings(rendering_color_space="lin_ap1_scene")
APPLIED = '(prepend apiSchemas = ["ColorSpaceAPI"])'
AP1_HERE = 'uniform token colorSpace:name = "lin_ap1_scene"'
# A space with primaries of its own and a curve: colours of it are worked out by hand below.
DEFINED = """(prepend apiSchemas = ["ColorSpaceAPI", "ColorSpaceDefinitionAPI:ours"])
{
    uniform token colorSpace:name = "house"
    uniform token colorSpaceDefinition:ours:name = "house"
    float2 colorSpaceDefinition:ours:redChroma = (0.68, 0.32)
    float2 colorSpaceDefinition:ours:greenChroma = (0.265, 0.69)
    float2 colorSpaceDefinition:ours:blueChroma = (0.15, 0.06)
    float2 colorSpaceDefinition:ours:whitePoint = (0.3127, 0.329)
    float colorSpaceDefinition:ours:gamma = 2.4
    float colorSpaceDefinition:ours:linearBias = 0.055
"""
HOUSE = between(P3_D65, PUBLISHED) @ from_srgb(RGB)

Doubles = npt.NDArray[np.float64]


def close(found: object, expected: npt.ArrayLike) -> bool:
    return bool(np.allclose(np.asarray(found, np.float64), expected, rtol=3e-6, atol=3e-6))


def quiet(text: str, settings: RenderSettings | None = None) -> SceneDescription:
    """Translated without a word about colours."""
    description, found = translate_text(text, settings)
    assert [code for code, _ in found if code in ("color-space", "api-schema", "unknown-input")] == []
    return description


def ball(color: str, around: str = "", before: str = "") -> str:
    return f"""
def Xform "top" {before or "{"}
    {around}
    def Sphere "ball"
    {{
        color3f[] primvars:displayColor = [{RGB}] {color}
    }}
}}
"""


def lamp(body: str, around: str = "", before: str = "") -> str:
    return f'def Xform "top" {before or "{"}\n{around}\ndef SphereLight "lamp"\n{{\n{body}\n}}\n}}\n'


def shown(text: str, settings: RenderSettings | None = None) -> tuple[float, ...]:
    (surface,) = quiet(text, settings).surfaces
    return surface.diffuse_color


def emitted(text: str, settings: RenderSettings | None = None) -> tuple[float, ...]:
    (light,) = quiet(text, settings).lights
    return light.emission


# ---- who says it --------------------------------------------------------------------------------------------------------


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
        ("whitePoint = (0.3457, 0.3585)", lambda: between((*P3_D65[:3], (0.3457, 0.3585)), PUBLISHED, adapt=False) @ from_srgb(RGB)),
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
    from primray.diagnostics import Diagnostics

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
    from primray.diagnostics import Diagnostics

    ctx = Context(stage, RenderSettings(), when_of(stage, None), (), (), Diagnostics())
    assert scope_at(stage.GetPrimAtPath("/a/b"), ctx) is NOWHERE


# ---- lights -------------------------------------------------------------------------------------------------------------


@pytest.mark.conforms("LightAPI.inputs:color")
def test_a_lights_color_is_in_the_rendering_space_unless_authored() -> None:
    body = f"color3f inputs:color = {RGB} %s\nfloat inputs:intensity = 1"
    assert emitted(lamp(body % ""), IN_AP1) == pytest.approx(RGB)
    assert close(emitted(lamp(body % '(colorSpace = "lin_rec709_scene")'), IN_AP1), TO_AP1 @ RGB)
    assert close(emitted(lamp(body % "", AP1_HERE, APPLIED + "{"), RenderSettings()), FROM_AP1 @ RGB)
    assert emitted(lamp(body % "", AP1_HERE, APPLIED + "{"), IN_AP1) == pytest.approx(RGB)


@pytest.mark.conforms("LightAPI.inputs:colorTemperature", "LightAPI.inputs:enableColorTemperature")
def test_blackbodies_are_rec709_taken_to_the_rendering_space() -> None:
    body = f"color3f inputs:color = {RGB}\nbool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 2856\nfloat inputs:intensity = 1"
    kelvin = np.array(UsdLux.BlackbodyTemperatureAsRgb(2856))
    assert close(emitted(lamp(body)), kelvin * RGB)
    assert close(emitted(lamp(body), IN_AP1), (TO_AP1 @ kelvin) * RGB)
    assert close(emitted(lamp(body.replace("Temperature = 1", "Temperature = 0")), IN_AP1), RGB)


# ---- displayColor -------------------------------------------------------------------------------------------------------

SQUARE = """
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "%s"
"""
COUNTS = {"constant": 1, "uniform": 2, "vertex": 4, "varying": 4, "faceVarying": 6}


@pytest.mark.conforms("Gprim.primvars:displayColor")
@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
@pytest.mark.parametrize("interpolation", COUNTS)
def test_every_interpolation(interpolation: str, scheme: str) -> None:
    colors = np.random.default_rng(2).random((COUNTS[interpolation], 3)).astype(np.float32)
    listed = ", ".join(str(tuple(map(float, c))) for c in colors)
    text = f'def Mesh "m" {{ {SQUARE % scheme}\ncolor3f[] primvars:displayColor = [{listed}] (interpolation = "{interpolation}")\n}}'
    plain, turned = quiet(text), quiet(text, IN_AP1)
    assert close(_colors(turned), _colors(plain) @ TO_AP1.T)
    assert not close(_colors(turned), _colors(plain))


def _colors(description: SceneDescription) -> Doubles:
    (shape,) = description.shapes
    values = getattr(shape, "colors", None)
    if values is None:
        return np.array([description.surfaces[0].diffuse_color])
    return np.asarray(getattr(values, "values", values), np.float64).reshape(-1, 3)


@pytest.mark.conforms("Gprim.primvars:displayColor")
def test_an_inherited_color_is_in_the_space_of_who_authors_it() -> None:
    text = f"""
def Xform "top" {APPLIED}
{{
    {AP1_HERE}
    color3f[] primvars:displayColor = [{RGB}]
    def Sphere "ball" {APPLIED}
    {{
        uniform token colorSpace:name = "srgb_rec709_scene"
    }}
}}"""
    assert close(shown(text), FROM_AP1 @ RGB)


@pytest.mark.conforms("Gprim.primvars:displayColor")
def test_indexed_values_and_what_leaves_the_space() -> None:
    """AP1's green has less than no red in Rec.709: it is clamped, and told."""
    indexed = 'color3f[] primvars:displayColor = [(0, 1, 0), (0.5, 0.5, 0.5)] (interpolation = "vertex"\ncolorSpace = "lin_ap1_scene")\nint[] primvars:displayColor:indices = [0, 1, 1, 1]'
    description, found = translate_text(f'def Mesh "m" {{ {SQUARE % "none"}\n{indexed}\n}}')
    assert ("material-input", "/m") in found
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert mesh.colors is not None
    found = sorted(set(map(tuple, mesh.colors.tolist())))
    assert close(found, [(0, 1, 0), (0.5, 0.5, 0.5)])


def test_points_and_point_instancers() -> None:
    colors = "color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)]"
    text = f"""
def Points "points"
{{
    point3f[] points = [(0, 0, 0), (1, 0, 0)]
    {colors} (interpolation = "vertex")
}}
def PointInstancer "many"
{{
    rel prototypes = </many/one>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 1, 0), (1, 1, 0)]
    {colors} (interpolation = "vertex")
    def Sphere "one"
    {{
    }}
}}"""
    description = quiet(text, IN_AP1)
    given = [primvar for placement in description.placements for primvar in placement.primvars]
    assert len(given) == 2
    for primvar in given:
        assert close(primvar.values, TO_AP1.T[:2])


# ---- materials ----------------------------------------------------------------------------------------------------------


def bound(inputs: str, nodes: str = "", interface: str = "", around: str = "", before: str = "") -> str:
    return f"""
def Material "m" {before or "{"}
    {around}
    {interface}
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        {inputs}
        token outputs:surface
    }}
    {nodes}
}}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </m>
    color3f[] primvars:paint = [{RGB}]
}}
"""


@pytest.mark.conforms(
    "UsdPreviewSurface.inputs:diffuseColor", "UsdPreviewSurface.inputs:emissiveColor", "UsdPreviewSurface.inputs:specularColor"
)
@pytest.mark.parametrize(
    ("name", "field"),
    [("diffuseColor", "diffuse_color"), ("emissiveColor", "emissive_color"), ("specularColor", "specular_color")],
)
def test_color_inputs(name: str, field: str) -> None:
    def value(text: str, settings: RenderSettings | None = None) -> object:
        return getattr(quiet(text, settings).surfaces[0], field)

    line = f"color3f inputs:{name} = {RGB}"
    assert value(bound(line)) == pytest.approx(RGB)
    assert close(value(bound(line), IN_AP1), TO_AP1 @ RGB)
    assert close(value(bound(f'{line} (colorSpace = "lin_ap1_scene")')), FROM_AP1 @ RGB)
    assert close(value(bound(line, around=AP1_HERE, before=APPLIED + "{")), FROM_AP1 @ RGB)
    through = bound(
        f"color3f inputs:{name}.connect = </m.inputs:c>", interface=f'color3f inputs:c = {RGB} (colorSpace = "data")'
    )
    assert value(through, IN_AP1) == pytest.approx(RGB)


READER = """
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "%s"
        float3 inputs:fallback = (0.6, 0.3, 0.2)
        float3 outputs:result
    }"""


def test_what_a_reader_gives_a_color() -> None:
    connected = "color3f inputs:diffuseColor.connect = </m/r.outputs:result>"
    description = quiet(bound(connected, READER % "paint"), IN_AP1)
    (surface,) = description.surfaces
    reads = dict(surface.inputs)["diffuse_color"]
    assert isinstance(reads, PrimvarInput)
    assert close(reads.fallback, TO_AP1 @ RGB)
    (sphere,) = description.shapes
    assert isinstance(sphere, Sphere)
    assert close(sphere.primvars[0].values, TO_AP1 @ RGB)


def test_numbers_that_no_color_reads_stay() -> None:
    reader = (
        (READER % "paint").replace('Reader_float3"', 'Reader_float"').replace("float3 inputs:fallback = (0.6, 0.3, 0.2)", "")
    )
    connected = "float inputs:roughness.connect = </m/r.outputs:result>"
    (sphere,) = quiet(bound(connected, reader), IN_AP1).shapes
    assert isinstance(sphere, Sphere)
    assert close(sphere.primvars[0].values, [RGB[:1]])


def test_a_constant_primvar_from_above_is_in_the_space_there() -> None:
    text = bound("color3f inputs:diffuseColor.connect = </m/r.outputs:result>", READER % "handed")
    top = f'def Xform "top" {APPLIED}\n{{\n{AP1_HERE}\ncolor3f[] primvars:handed = [{RGB}]\n'
    inside = text.replace('def Sphere "ball"', top + 'def Sphere "ball"').rstrip() + "\n}\n"
    assert close(quiet(inside).shapes[0].primvars[0].values, FROM_AP1 @ RGB)  # type: ignore[union-attr]


def test_draw_mode_colors() -> None:
    text = f"""
def Xform "model" (kind = "component"
    prepend apiSchemas = ["GeomModelAPI"])
{{
    uniform token model:drawMode = "origin"
    uniform bool model:applyDrawMode = 1
    float3 model:drawModeColor = {RGB}
    def Sphere "ball" {{
    }}
}}"""
    assert close(quiet(text, IN_AP1).surfaces[0].diffuse_color, TO_AP1 @ RGB)


# ---- instances ----------------------------------------------------------------------------------------------------------


def instances(kind: str, inner: str) -> str:
    """The same prototype below three scopes of different spaces."""
    spaces = {"a": AP1_HERE, "b": 'uniform token colorSpace:name = "srgb_rec709_scene"', "c": AP1_HERE}
    made = [f'class Xform "_proto"\n{{\n{inner}\n}}']
    for name, line in spaces.items():
        one = f'def Xform "one" (instanceable = true\nprepend references = </_proto>)\n{{\n}}'
        made.append(f'def {kind} "{name}" {APPLIED}\n{{\n{line}\n{one}\n}}')
    return "\n".join(made)


@pytest.mark.conforms("ColorSpaceAPI.colorSpace:name")
def test_what_is_above_an_instance_reaches_into_it() -> None:
    ball = f'def Sphere "ball" {{ color3f[] primvars:displayColor = [{RGB}]\n}}'
    description = quiet(instances("Xform", ball))
    colors = sorted(surface.diffuse_color for surface in description.surfaces)
    assert close(colors, sorted([tuple(FROM_AP1 @ RGB), tuple(from_srgb(RGB))]))
    placed = sum(len(p) for p in description.placements)
    assert (placed, len(description.static)) == (2, 1)  # the two alike share a prototype


@pytest.mark.conforms("ColorSpaceAPI.colorSpace:name")
def test_materials_inside_instances() -> None:
    inside = bound(f"color3f inputs:diffuseColor = {RGB}").replace("</m", "</_proto/m")
    description = quiet(instances("Xform", inside))
    used = {int(np.asarray(shape.surface)) for shape in description.shapes}
    colors = sorted(description.surfaces[i].diffuse_color for i in used)
    assert close(colors, sorted([tuple(FROM_AP1 @ RGB), tuple(from_srgb(RGB))]))


def test_nested_instances_and_lights_in_them() -> None:
    inner = (
        f'class Xform "_inner"\n{{\ndef SphereLight "l" {{ color3f inputs:color = {RGB}\nfloat inputs:intensity = 1\n}}\n}}\n'
    )
    outer = 'def Xform "two" (instanceable = true\nprepend references = </_inner>)\n{\n}'
    description = quiet(inner + instances("Xform", outer))
    found = sorted(light.emission for light in description.lights)
    assert close(found, sorted([tuple(FROM_AP1 @ RGB)] * 2 + [tuple(from_srgb(RGB))]))


def test_prototypes_of_point_instancers_go_by_namespace() -> None:
    text = f"""
def Scope "elsewhere" {APPLIED}
{{
    {AP1_HERE}
    def Sphere "one"
    {{
        color3f[] primvars:displayColor = [{RGB}]
    }}
}}
def PointInstancer "many" {APPLIED}
{{
    uniform token colorSpace:name = "srgb_rec709_scene"
    rel prototypes = </elsewhere/one>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 1, 0), (1, 1, 0)]
}}"""
    assert all(close(surface.diffuse_color, FROM_AP1 @ RGB) for surface in quiet(text).surfaces)


# ---- the rendering space ------------------------------------------------------------------------------------------------


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
    with pytest.raises(SettingsError, match="colour space|linear RGB"):
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
