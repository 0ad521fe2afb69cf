"""Shapes that are lights, and lights that name geometry."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.usd.lights.light_text import told, translated

from primray.description import LightType, SceneDescription
from primray.diagnostics import Diagnostic

GLOW = """
def Material "m" {
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s" { uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (0.5, 1, 2)
        color3f inputs:diffuseColor = (0.25, 0.25, 0.25)
        token outputs:surface }
}
"""


BODIES = {
    "Mesh": "int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n"
    "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n uniform token subdivisionScheme = \"none\"",
    "Sphere": "",
    "Cube": "",
    "Cylinder": "",
    "Capsule": "",
    "Cone": "",
    "Plane": "",
}  # fmt: skip


SUBDIVIDED = BODIES["Mesh"].replace('"none"', '"catmullClark"')


def shape_light(kind: str, body: str, schema: str = "LightAPI", extra: str = "") -> tuple[SceneDescription, list[Diagnostic]]:
    return translated(
        f'def {kind} "x" (prepend apiSchemas = ["{schema}", "MaterialBindingAPI"]) '
        f"{{ {body}\n rel material:binding = </m>\n float inputs:intensity = 3\n float inputs:exposure = 1\n {extra} }}\n{GLOW}"
    )


ROWS: tuple[str, ...] = ("LightAPI.light:materialSyncMode", "MeshLightAPI.light:materialSyncMode", "LightAPI.inputs:intensity")
ROWS += ("LightAPI.inputs:exposure", "LightAPI.light:shaderId", "MeshLightAPI.light:shaderId")


@pytest.mark.conforms(*ROWS)
@pytest.mark.parametrize("kind", [*BODIES, "subdivided"])
@pytest.mark.parametrize("schema", ["LightAPI", "MeshLightAPI"])
@pytest.mark.parametrize("mode", ["", "materialGlowTintsLight", "independent", "noMaterialResponse"])
def test_shapes_that_are_lights(kind: str, schema: str, mode: str) -> None:
    body = SUBDIVIDED if kind == "subdivided" else BODIES[kind]
    extra = f'uniform token light:materialSyncMode = "{mode}"' if mode else ""
    description, found = shape_light("Mesh" if kind == "subdivided" else kind, body, schema, extra)
    (shape,) = description.shapes
    light = shape.light
    assert light is not None
    assert description.lights == ()
    assert (light.type, light.emission) == (LightType.GEOMETRY, (6, 6, 6))
    # The schemas' own defaults: noMaterialResponse for LightAPI, materialGlowTintsLight for MeshLightAPI.
    mode = mode or ("materialGlowTintsLight" if schema == "MeshLightAPI" else "noMaterialResponse")
    assert (light.own_color, light.shows_own) == (mode != "materialGlowTintsLight", mode == "noMaterialResponse")
    surface = description.surfaces[int(np.max(shape.surface))]
    if mode == "noMaterialResponse":
        assert (surface.lambert, surface.diffuse_color, surface.emissive_color) == (True, (0, 0, 0), (1, 1, 1))
    else:
        assert (surface.path, surface.emissive_color) == ("/m", (0.5, 1, 2))
    assert not [d for d in found if d.code not in ("tessellated", "camera-automatic")]


@pytest.mark.conforms(
    "LightAPI.inputs:color", "LightAPI.inputs:normalize", "LightAPI.inputs:diffuse", "LightAPI.inputs:specular",
    "LightAPI.inputs:enableColorTemperature", "LightAPI.inputs:colorTemperature",
)  # fmt: skip
def test_inputs_of_shapes_that_are_lights() -> None:
    description, _ = shape_light(
        "Sphere", "", extra="color3f inputs:color = (1, 0.5, 0)\n bool inputs:normalize = 1\n float inputs:diffuse = 0.25\n"
        "float inputs:specular = 2\n bool inputs:enableColorTemperature = 1\n float inputs:colorTemperature = 3000",
    )  # fmt: skip
    from pxr import UsdLux

    light = description.shapes[0].light
    assert light is not None
    tint = UsdLux.BlackbodyTemperatureAsRgb(3000)
    assert light.emission == pytest.approx((6 * tint[0], 3 * tint[1], 0), rel=1e-6)
    assert (light.normalize, light.diffuse, light.specular) == (True, 0.25, 2)


@pytest.mark.conforms("MeshLightAPI.light:materialSyncMode", state="honoured")
def test_no_glow_to_tint_is_told() -> None:
    dark = GLOW.replace("color3f inputs:emissiveColor = (0.5, 1, 2)", "")
    body = f"{BODIES['Mesh']}\n rel material:binding = </m>"
    text = f'def Mesh "x" (prepend apiSchemas = ["MeshLightAPI", "MaterialBindingAPI"]) {{ {body} }}\n'
    assert told(translated(text + GLOW)[1], "/x") == []
    assert told(translated(text + dark)[1], "/x") == [("light-dark", "light:materialSyncMode")]


@pytest.mark.conforms("MeshLightAPI.light:materialSyncMode")
@pytest.mark.parametrize("mode", ["materialGlowTintsLight", "independent"])
def test_without_a_material_there_is_no_glow_to_relate_to(mode: str) -> None:
    """The modes are "for a LightAPI applied to geometry that has a bound Material"."""
    text = f'def Sphere "x" (prepend apiSchemas = ["MeshLightAPI"]) {{ uniform token light:materialSyncMode = "{mode}" }}'
    description, found = translated(text)
    light = description.shapes[0].light
    assert light is not None
    assert (light.own_color, light.shows_own) == (True, True)
    assert told(found, "/x") == []


def test_a_mode_that_is_none_is_told() -> None:
    _, found = shape_light("Sphere", "", extra='uniform token light:materialSyncMode = "sometimes"')
    assert ("light-input", "light:materialSyncMode") in told(found, "/x")


SHADERS = {name: name for name in ("DistantLight", "DiskLight", "RectLight", "SphereLight", "CylinderLight", "DomeLight")}
SHADERS["DomeLight_1"] = "DomeLight"


@pytest.mark.conforms("LightAPI.light:shaderId", *(f"{kind}.light:shaderId" for kind in SHADERS), state="diagnosed")
@pytest.mark.parametrize("kind", SHADERS)
def test_other_shaders_are_told(kind: str) -> None:
    _, found = translated(f'def {kind} "x" {{ uniform token light:shaderId = "MyLight" }}')
    assert told(found, "/x") == [("light-input", "light:shaderId")]
    _, found = translated(f'def {kind} "x" {{ uniform token light:shaderId = "{SHADERS[kind]}" }}')
    assert told(found, "/x") == []


@pytest.mark.parametrize("kind", ["BasisCurves", "Points", "Xform"])
def test_what_cannot_be_a_light_is_told(kind: str) -> None:
    _, found = translated(f'def {kind} "x" (prepend apiSchemas = ["LightAPI"]) {{ }}')
    assert "unsupported-light" in [code for code, _ in told(found, "/x")]


def test_a_prototype_holds_its_light() -> None:
    """Instanced twice: one shape, one light, two places."""
    text = (
        'class "c" { def Sphere "x" (prepend apiSchemas = ["LightAPI"]) { bool inputs:normalize = 1 } }\n'
        'def "a" (instanceable = true\n prepend inherits = </c>) { double3 xformOp:translate = (1, 0, 0)\n'
        'uniform token[] xformOpOrder = ["xformOp:translate"] }\n'
        'def "b" (instanceable = true\n prepend inherits = </c>) { }'
    )
    description, _ = translated(text)
    assert [s.light is not None for s in description.shapes] == [True]
    assert sum(map(len, description.placements)) == 2


SHAPE = 'def Mesh "m" { int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n '
SHAPE += 'point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n uniform token subdivisionScheme = "none" MORE }\n'


@pytest.mark.conforms("GeometryLight.geometry", "GeometryLight.light:shaderId")
def test_a_geometry_light_is_its_geometry() -> None:
    """As LightAPI on that, with the same inputs."""
    inputs = "float inputs:intensity = 3\n color3f inputs:color = (1, 0.5, 0.25)\n bool inputs:normalize = 1"
    made, found = translated(SHAPE.replace("MORE", "") + f'def GeometryLight "g" {{ {inputs}\n rel geometry = </m> }}')
    assert [d for d in found if d.prim_path in ("/g", "/m")] == []
    plain, _ = translated(SHAPE.replace("MORE", "\n " + inputs).replace('"m"', '"m" (prepend apiSchemas = ["LightAPI"])'))
    assert made.shapes[0].light is not None
    assert repr(made.shapes[0].light) == repr(plain.shapes[0].light)
    hidden, _ = translated(
        SHAPE.replace("MORE", "") + 'def GeometryLight "g" { token visibility = "invisible"\n rel geometry = </m> }'
    )
    assert hidden.shapes[0].light is None
    _, found = translated('def Xform "m" { }\ndef GeometryLight "g" { rel geometry = </m> }')
    assert told(found, "/g") == [("light-input", "geometry")]


def in_instances(inside: str, outside: str = "", names: str = "ab") -> list[bool]:
    """Whether shapes of instances of one prototype give light, one instance after the other."""
    instances = "".join(f'def Xform "{name}" (instanceable = true\n references = </kind>) {{ }}\n' for name in names)
    made, found = translated(f'over "kind" {{\ndef Cube "p" {{ }}\n def Cube "q" {{ }}\n {inside} }}\n{instances}{outside}')
    assert not [d for d in found if d.code in ("unsupported-light", "light-input")]
    lit = {made.shapes[placed.shape].path: made.shapes[placed.shape].light is not None for placed in made.static}
    for placement in made.placements:
        for placed in made.prototypes[placement.prototype].shapes:
            lit[made.shapes[placed.shape].path] = made.shapes[placed.shape].light is not None
    return [lit.get(f"/{name}/{shape}", False) for name in names for shape in "pq"]


@pytest.mark.parametrize(("names", "expected"), [("a", [True, True]), ("ab", [True, True, False, False])])
def test_geometry_of_one_instance_gives_light_together(names: str, expected: list[bool]) -> None:
    """The instance ends with the first of its shapes, and with the last instance its prototype."""
    assert in_instances("", 'def GeometryLight "g" { rel geometry = [</a/p>, </a/q>] }', names) == expected


def test_a_geometry_light_in_an_instance_is_the_geometry_there() -> None:
    assert in_instances('def GeometryLight "g" { rel geometry = </kind/q> }') == [False, True, False, True]


def test_geometry_gives_the_light_of_one() -> None:
    lights = 'def GeometryLight "g" { float inputs:intensity = 2\n rel geometry = </m> }\n'
    made, found = translated(SHAPE.replace("MORE", "") + lights + lights.replace('"g"', '"h"').replace("2", "3"))
    assert made.shapes[0].light is not None
    one, _ = translated(SHAPE.replace("MORE", "") + lights)
    assert repr(made.shapes[0].light) == repr(one.shapes[0].light)
    assert told(found, "/h") == [("light-input", "geometry")]


@pytest.mark.parametrize("how", ['uniform token purpose = "guide"', 'token visibility = "invisible"'])
def test_a_geometry_light_that_is_not_rendered_gives_nothing(how: str) -> None:
    made, _ = translated(SHAPE.replace("MORE", "") + f'def GeometryLight "g" {{ {how}\n rel geometry = </m> }}')
    assert made.shapes[0].light is None


def test_geometry_below_its_light_stays() -> None:
    shape = SHAPE.replace("MORE", "")
    made, found = translated(
        f'def GeometryLight "g" {{ rel geometry = </g/m>\n {shape} {shape.replace(chr(34) + "m", chr(34) + "n")} }}'
    )
    assert [(made.shapes[one.shape].path, made.shapes[one.shape].light is not None) for one in made.static] == [
        ("/g/m", True),
        ("/g/n", False),
    ]
    assert told(found, "/g") == []


def test_a_geometry_light_that_composes_another_gives_its_own_light() -> None:
    other = SHAPE.replace("MORE", "").replace('"m"', '"n"').replace("(1, 0, 0)", "(2, 0, 0)")
    lights = 'def GeometryLight "g" { rel geometry = </m> }\ndef GeometryLight "h" (references = </g>) { rel geometry = </n> }'
    made, _ = translated(SHAPE.replace("MORE", "") + other + lights)
    assert [shape.light is not None for shape in made.shapes] == [True, True]
