"""How often things are asked for while many materials of one network are read: counts, which no machine's load changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from tests.unit.usd.usd_text import translate_text

from primray.description import NodeOutput, PatternInput, PatternNode
from primray.usd import view_setup
from primray.usd.materials import authored, material_primvars, recipes, texture_files
from primray.usd.materials.materialx import definitions, expressions, filename_tokens
from primray.usd.materials.surface_inputs import pruned

SHADERS = ("s", "twice", "noise", "contrast", "place")


def looks(first: int, end: int) -> str:
    """Balls with materials of one network and other constants; the noise is read by two inputs, each node but once."""
    return "\n".join(_look(number) for number in range(first, end))


def _look(number: int) -> str:
    shaders = {
        "s": ("standard_surface_surfaceshader", "color3f base_color < twice", "float specular_roughness < noise"),
        "twice": ("multiply_color3FA", "color3f in1 < contrast", "float in2 < noise"),
        "noise": ("fractal3d_float", f"float amplitude = 0.{number + 1}"),
        "contrast": ("contrast_color3", "color3f in < place", f"color3f amount = (1, 0.5, 0.{number + 1})"),
        "place": ("position_vector3",),
    }
    return f"""
def Material "m{number}"
{{
    token outputs:mtlx:surface.connect = </m{number}/s.outputs:out>
    {"".join(_shader(number, name, *lines) for name, lines in shaders.items())}
}}
def Sphere "ball{number}" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </m{number}>
}}"""


def _shader(number: int, name: str, kind: str, *inputs: str) -> str:
    lines = [line.replace(" ", " inputs:", 1) for line in inputs]
    lines = [f"{at}.connect = </m{number}/{of}.outputs:out>" if of else at for at, _, of in (x.partition(" < ") for x in lines)]
    return "\n".join([f'def Shader "{name}" {{', f'uniform token info:id = "ND_{kind}"', *lines, "token outputs:out", "}\n"])


def _counted(monkeypatch: pytest.MonkeyPatch, name: str, module: Any = authored) -> Counter[str]:
    """Return calls of a function by which a module reads networks, by path of the prim or attribute that is read."""
    calls: Counter[str] = Counter()
    before: Callable[..., Any] = getattr(module, name)

    def counting(of: Any, *others: Any) -> Any:
        calls[str(of.GetPath())] += 1
        return before(of, *others)

    monkeypatch.setattr(module, name, counting)
    return calls


def test_each_shader_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ids = _counted(monkeypatch, "shader_id", material_primvars)  # which looks at all shaders of a stage
    others, names = _counted(monkeypatch, "shader_id"), _counted(monkeypatch, "property_names")
    by_recipe = _counted(monkeypatch, "property_names", recipes)
    description, _ = translate_text(looks(0, 3))
    assert len(description.surfaces) == 3
    assert all(surface.pattern is not None for surface in description.surfaces)
    each = Counter({f"/m{number}/{name}": 1 for number in range(3) for name in SHADERS})
    assert (ids, others) == (each, Counter())
    assert names + by_recipe == each + Counter({f"/m{number}": 1 for number in range(3)})
    assert {path.split("/")[1] for path in by_recipe} == {"m2"}  # the second leaves the recipe


READS = ("shader_id", "property_names", "connections", "value", "color_space_name", "default_value")
TEXTURED = """
def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    string inputs:st = "map1"
    asset inputs:image = @missing.<UDIM>.png@ (colorSpace = "srgb_texture")
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>
        float inputs:roughness.connect = </m/image.outputs:g>
        float inputs:metallic.connect = </m/image.outputs:b>
        float inputs:displacement.connect = </m/image.outputs:r>
        token outputs:surface
    }
    def Shader "image"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file.connect = </m.inputs:image>
        float2 inputs:st.connect = </m/place.outputs:result>
        float4 inputs:fallback = (0.5, 0.5, 0.5, 1)
        float4 inputs:scale = (2, 2, 2, 1)
        token inputs:wrapS = "repeat"
        token inputs:sourceColorSpace = "auto"
    }
    def Shader "place"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </m/st.outputs:result>
        float2 inputs:scale = (2, 2)
    }
    def Shader "st"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname.connect = </m.inputs:st>
    }
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
}"""


@pytest.mark.parametrize("text", [TEXTURED, looks(0, 1)], ids=["preview surface", "MaterialX"])
def test_each_attribute_is_read_once(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = {name: _counted(monkeypatch, name) for name in READS}
    search = material_primvars.primvars_read

    def searched(*args: Any) -> Any:  # for the primvars that any material of the stage reads: a pass of its own
        found = search(*args)
        for of in calls.values():
            of.clear()
        return found

    monkeypatch.setattr(view_setup, "primvars_read", searched)
    translate_text(text)
    repeated = {name: {path: n for path, n in of.items() if n > 1} for name, of in calls.items()}
    assert repeated == {name: {} for name in READS}
    assert calls["connections"].total() > 5
    assert not calls["shader_id"]


def test_definitions_are_parsed_once_a_process() -> None:
    translate_text(looks(0, 1))
    caches = (definitions.definition, definitions.graph, expressions._residual_of)
    before = [cache.cache_info().misses for cache in caches]
    translate_text(looks(1, 9))
    assert [cache.cache_info().misses for cache in caches] == before


def test_what_pruning_leaves_as_it_is_is_not_made_again() -> None:
    def reading(*nodes: int) -> PatternNode:
        inputs = tuple((f"in{place + 1}", NodeOutput(node)) for place, node in enumerate(nodes))
        return PatternNode("add", "float", "ND_add_float", inputs)

    nodes = [reading(), reading(0), reading(), reading(), reading(1, 3)]
    pattern, inputs = pruned(nodes, {"roughness": PatternInput(NodeOutput(4), (0.5,))})
    assert pattern is not None
    assert [kept is node for kept, node in zip(pattern.nodes, [*nodes[:2], *nodes[3:]], strict=True)] == [
        True,
        True,
        True,
        False,
    ]
    assert pattern.nodes[3] == reading(1, 2)
    assert inputs == {"roughness": PatternInput(NodeOutput(3), (0.5,))}


def test_files_are_resolved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four inputs read channels of the image, as colours and as numbers."""
    names: Counter[str] = Counter()
    resolve = filename_tokens.tile_paths

    def counting(path: str, layer: Any) -> Any:
        names[path] += 1
        return resolve(path, layer)

    monkeypatch.setattr(texture_files, "tile_paths", counting)
    translate_text(TEXTURED)
    assert names == {"missing.<UDIM>.png": 1}
