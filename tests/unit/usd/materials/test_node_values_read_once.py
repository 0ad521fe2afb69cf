"""How often things are asked for while many materials of one network are read: counts, which no machine's load changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from tests.unit.usd.usd_text import translate_text

from primray.description import NodeOutput, PatternInput, PatternNode
from primray.usd.materials import material_primvars, network, node_values
from primray.usd.materials.materialx import definitions, expressions
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


def _counted(monkeypatch: pytest.MonkeyPatch, module: Any, name: str) -> Counter[str]:
    """By the prims that a function of the module is called for."""
    told: Counter[str] = Counter()
    before: Callable[[Any], Any] = getattr(module, name)

    def counting(prim: Any) -> Any:
        told[str(prim.GetPath())] += 1
        return before(prim)

    monkeypatch.setattr(module, name, counting)
    return told


def test_each_shader_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ids = _counted(monkeypatch, material_primvars, "shader_id")  # which looks at all shaders of a stage
    others = _counted(monkeypatch, network, "shader_id")
    names = _counted(monkeypatch, node_values, "property_names")
    description, _ = translate_text(looks(0, 3))
    assert len(description.surfaces) == 3
    assert all(surface.pattern is not None for surface in description.surfaces)
    each = Counter({f"/m{number}/{name}": 1 for number in range(3) for name in SHADERS})
    assert (ids, others, names) == (each, Counter(), each)


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
