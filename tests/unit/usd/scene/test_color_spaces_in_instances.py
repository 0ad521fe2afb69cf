"""Colours of lights, shapes, materials and instances arrive in the rendering space."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import UsdLux
from tests.colorimetry import from_srgb

from primray.description import Mesh, PrimvarInput, SceneDescription, Sphere
from primray.settings import RenderSettings

from ..color_text import AP1_HERE, APPLIED, FROM_AP1, IN_AP1, RGB, TO_AP1, Doubles, close, emitted, lamp, quiet, shown
from ..usd_text import translate_text


@pytest.mark.conforms("LightAPI.inputs:color")
def test_a_lights_color_is_in_the_rendering_space_unless_authored() -> None:
    body = f"color3f inputs:color = {RGB} %s\nfloat inputs:intensity = 1"
    assert emitted(lamp(body % ""), IN_AP1) == pytest.approx(RGB)
    assert close(emitted(lamp(body % '(colorSpace = "lin_rec709_scene")'), IN_AP1), TO_AP1 @ RGB)
    assert close(emitted(lamp(body % "", AP1_HERE, APPLIED + "{"), RenderSettings()), FROM_AP1 @ RGB)
    assert emitted(lamp(body % "", AP1_HERE, APPLIED + "{"), IN_AP1) == pytest.approx(RGB)


@pytest.mark.conforms("LightAPI.inputs:colorTemperature", "LightAPI.inputs:enableColorTemperature")
def test_blackbodies_are_rec709_taken_to_the_rendering_space() -> None:
    body = f"color3f inputs:color = {RGB}\nfloat inputs:intensity = 1\n"
    body += "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 2856"
    kelvin = np.array(UsdLux.BlackbodyTemperatureAsRgb(2856))
    assert close(emitted(lamp(body)), kelvin * RGB)
    assert close(emitted(lamp(body), IN_AP1), (TO_AP1 @ kelvin) * RGB)
    assert close(emitted(lamp(body.replace("Temperature = 1", "Temperature = 0")), IN_AP1), RGB)


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
    primvar = f'color3f[] primvars:displayColor = [{listed}] (interpolation = "{interpolation}")'
    text = f'def Mesh "m" {{ {SQUARE % scheme}\n{primvar}\n}}'
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
    values = "color3f[] primvars:displayColor = [(0, 1, 0), (0.5, 0.5, 0.5)]"
    indexed = values + '(interpolation = "vertex"\ncolorSpace = "lin_ap1_scene")\n'
    indexed += "int[] primvars:displayColor:indices = [0, 1, 1, 1]"
    description, found = translate_text(f'def Mesh "m" {{ {SQUARE % "none"}\n{indexed}\n}}')
    assert ("out-of-range", "/m") in found
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


def instances(kind: str, inner: str) -> str:
    """The same prototype below three scopes of different spaces."""
    spaces = {"a": AP1_HERE, "b": 'uniform token colorSpace:name = "srgb_rec709_scene"', "c": AP1_HERE}
    made = [f'class Xform "_proto"\n{{\n{inner}\n}}']
    for name, line in spaces.items():
        one = 'def Xform "one" (instanceable = true\nprepend references = </_proto>)\n{\n}'
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
