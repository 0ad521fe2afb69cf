"""Prims whose types have no schema are what fallbackPrimTypes of the stage name, wherever a prim's type is asked for."""

from __future__ import annotations

import pytest
from pxr import Usd

from primray.settings import RenderSettings
from primray.usd import camera_paths, products, translate
from primray.usd.stage.reads import schemas_applied, type_and_schemas, type_name

FALLBACKS = """#usda 1.0
(
    fallbackPrimTypes = {
        token[] Newer = ["Newest", "KIND"]
        token[] Cube = ["Sphere"]
    }
)
"""


def stage_of(kind: str, text: str) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(FALLBACKS.replace("KIND", kind) + text)
    return stage


@pytest.mark.parametrize(
    ("authored", "taken_as"), [("Newer ", "Cone"), ("Cube ", "Cube"), ("Unheard ", "Unheard"), ("Gprim ", "Gprim"), ("", "")]
)
def test_the_type_of_a_prim(authored: str, taken_as: str) -> None:
    """A type that has a schema is that, whatever the stage says of it; one that nothing is said of keeps its name."""
    stage = stage_of("Cone", f'def {authored}"a" (prepend apiSchemas = ["CollectionAPI:c"])\n{{\n}}\n')
    prim = stage.GetPrimAtPath("/a")
    assert type_name(prim) == taken_as
    assert type_and_schemas(prim) == (taken_as, schemas_applied(prim)) == (taken_as, ["CollectionAPI:c"])


def test_cameras_settings_lights_and_instancers_are_found_by_it() -> None:
    ball = 'def Sphere "s"\n{\n}\n'
    assert camera_paths(stage_of("Camera", 'def Newer "a"\n{\n}\n')) == ["/a"]
    settings = products(stage_of("RenderSettings", 'def Newer "a"\n{\n int2 resolution = (5, 7)\n}\n'))
    assert [found.settings_path for found in settings] == ["/a"]
    lit, _ = translate(stage_of("SphereLight", ball + 'def Newer "a"\n{\n}\n'), RenderSettings())
    assert [light.path for light in lit.lights] == ["/a"]
    text = 'def Newer "a"\n{\n rel prototypes = </a/s>\n int[] protoIndices = [0, 0]\n'
    text += f" point3f[] positions = [(0, 0, 0), (9, 0, 0)]\n {ball}}}\n"
    instanced, said = translate(stage_of("PointInstancer", text), RenderSettings())
    assert [len(placement) for placement in instanced.placements] == [2]
    assert "unknown-prim-type" not in {d.code for d in said}


def test_materials_shaders_and_subsets_are_found_by_it() -> None:
    mesh = """def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    def SUBSET "half" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token elementType = "face"
        int[] indices = [1]
        uniform token familyName = "materialBind"
        rel material:binding = </red>
    }
}
"""
    material = """def MATERIAL "red"
{
    token outputs:surface.connect = </red/s.outputs:surface>
    def SHADER "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
"""
    for kind in ("GeomSubset", "Material", "Shader"):
        text = (mesh + material).replace(kind.removeprefix("Geom").upper(), "Newer")
        for other in ("GeomSubset", "Material", "Shader"):
            text = text.replace(other.removeprefix("Geom").upper(), other)
        description, _ = translate(stage_of(kind, text), RenderSettings())
        assert "/red" in {surface.path for surface in description.surfaces}, kind
