"""The shaders of a document's materials: each has inputs of its own, and the front of a surface is the surface."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.unit.usd.materials.materialx.documents import surface_of

from primray.description import PrimvarInput

EMITTER = """<nodedef name="ND_ms" node="ms"><input name="scale" type="float" value="1"/>
    <output name="out" type="surfaceshader"/></nodedef>
  <nodegraph name="NG_ms" nodedef="ND_ms">
    <convert name="c" type="color3"><input name="in" type="float" interfacename="scale"/></convert>
    <surface_unlit name="S" type="surfaceshader"><input name="emission_color" type="color3" nodename="c"/></surface_unlit>
    <output name="out" type="surfaceshader" nodename="S"/></nodegraph>"""
MOVED = """<displacement name="D" type="displacementshader"><input name="displacement" type="float" value="1"/>
  <input name="scale" type="float" value="2"/></displacement>"""


def unlit(name: str, color: str) -> str:
    given = f'<input name="emission_color" type="color3" value="{color}"/>'
    return f'<surface_unlit name="{name}" type="surfaceshader">{given}</surface_unlit>'


def document(nodes: str, *inputs: str) -> str:
    material = f'<surfacematerial name="M" type="material">{"".join(inputs)}</surfacematerial>'
    return f'<materialx version="1.39">{nodes}{material}</materialx>'


def shader(name: str, node: str, kind: str = "surfaceshader") -> str:
    return f'<input name="{name}" type="{kind}" nodename="{node}"/>'


SURFACE, BACK = shader("surfaceshader", "S"), shader("backsurfaceshader", "B")
DISPLACED = shader("displacementshader", "D", "displacementshader")


@pytest.mark.parametrize("order", [1, -1])
def test_two_shaders_with_an_input_of_one_name_have_each_its_own(order: int, tmp_path: Path) -> None:
    own = EMITTER + '<ms name="S" type="surfaceshader"><input name="scale" type="float" value="0.25"/></ms>' + MOVED
    surface, messages = surface_of(tmp_path, document(own, *(SURFACE, DISPLACED)[::order]))
    assert surface.emissive_color == pytest.approx((0.25, 0.25, 0.25))
    assert dict(surface.inputs)["displacement"] == PrimvarInput("", (2.0,))
    assert messages == []


def test_a_shader_that_says_nothing_of_a_name_keeps_its_default(tmp_path: Path) -> None:
    own = EMITTER + '<ms name="S" type="surfaceshader"/>' + MOVED
    surface, _ = surface_of(tmp_path, document(own, SURFACE, DISPLACED))
    assert surface.emissive_color == pytest.approx((1, 1, 1))
    own = EMITTER + '<ms name="S" type="surfaceshader"><input name="scale" type="float" value="0.25"/></ms>'
    moved = MOVED.replace('<input name="scale" type="float" value="2"/>', "")
    surface, _ = surface_of(tmp_path, document(own + moved, SURFACE, DISPLACED))
    assert dict(surface.inputs)["displacement"] == PrimvarInput("", (1.0,))


@pytest.mark.parametrize("inputs", [(SURFACE, BACK), (BACK, SURFACE)])
def test_the_back_is_never_the_front_and_is_reported(inputs: tuple[str, ...], tmp_path: Path) -> None:
    surface, messages = surface_of(tmp_path, document(unlit("S", "1, 0, 0") + unlit("B", "0, 1, 0"), *inputs))
    assert surface.emissive_color == (1, 0, 0)
    assert ["backsurfaceshader = B" in message for message in messages] == [True]


def test_a_back_alone_is_no_surface(tmp_path: Path) -> None:
    surface, messages = surface_of(tmp_path, document(unlit("B", "0, 1, 0"), BACK))
    assert surface.emissive_color == (0, 0, 0)
    assert any("backsurfaceshader" in message for message in messages)


def test_a_back_that_is_the_front_is_as_it_says(tmp_path: Path) -> None:
    both = shader("surfaceshader", "S") + shader("backsurfaceshader", "S")
    surface, messages = surface_of(tmp_path, document(unlit("S", "1, 0, 0"), both))
    assert (surface.emissive_color, messages) == ((1, 0, 0), [])


def test_a_shader_in_a_graph_has_what_it_is_connected_to_there(tmp_path: Path) -> None:
    graph = """<nodegraph name="G"><input name="tint" type="color3" value="0, 0.5, 1"/>
        <constant name="c" type="color3"><input name="value" type="color3" interfacename="tint"/></constant>
        <surface_unlit name="S" type="surfaceshader"><input name="emission_color" type="color3" nodename="c"/></surface_unlit>
        <output name="out" type="surfaceshader" nodename="S"/></nodegraph>
      <constant name="c" type="color3"><input name="value" type="color3" value="1, 0, 0"/></constant>"""
    given = '<input name="surfaceshader" type="surfaceshader" nodegraph="G" output="out"/>'
    surface, messages = surface_of(tmp_path, document(graph, given))
    assert (surface.emissive_color, messages) == ((0, 0.5, 1), [])


def test_materials_of_one_shader_and_graphs_given_other_values_are_their_own(tmp_path: Path) -> None:
    nodes = EMITTER + "".join(
        f'<ms name="{name}" type="surfaceshader"><input name="scale" type="float" value="{value}"/></ms>'
        for name, value in (("S", 0.25), ("T", 0.75))
    )
    others = "".join(
        f'<surfacematerial name="{name}" type="material">{shader("surfaceshader", node)}</surfacematerial>'
        for name, node in (("A", "S"), ("Z", "T"))
    )
    for node, wanted in (("S", 0.25), ("T", 0.75)):
        surface, _ = surface_of(tmp_path, document(nodes + others, shader("surfaceshader", node)))
        assert surface.emissive_color == pytest.approx((wanted,) * 3)


def test_a_material_of_the_documents_own_is_its_graph(tmp_path: Path) -> None:
    own = """<nodedef name="ND_lamp" node="lamp"><input name="tint" type="color3" value="1, 0, 0"/>
        <output name="out" type="material"/></nodedef>
      <nodegraph name="NG_lamp" nodedef="ND_lamp">
        <surface_unlit name="S" type="surfaceshader"><input name="emission_color" type="color3" interfacename="tint"/>
        </surface_unlit><surfacematerial name="m" type="material">
          <input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
        <output name="out" type="material" nodename="m"/></nodegraph>
      <lamp name="M" type="material"><input name="tint" type="color3" value="0, 0, 1"/></lamp>"""
    surface, messages = surface_of(tmp_path, f'<materialx version="1.39">{own}</materialx>')
    assert (surface.emissive_color, messages) == ((0, 0, 1), [])


def test_a_node_at_the_top_of_a_document_may_be_fed_by_a_graph(tmp_path: Path) -> None:
    nodes = """<nodegraph name="G">
        <constant name="k" type="color3"><input name="value" type="color3" value="0.5,1,1.5"/></constant>
        <output name="out" type="color3" nodename="k"/></nodegraph>
      <multiply name="t" type="color3"><input name="in1" type="color3" nodegraph="G" output="out"/>
        <input name="in2" type="color3" value="2,2,2"/></multiply>
      <surface_unlit name="S" type="surfaceshader"><input name="emission_color" type="color3" nodename="t"/></surface_unlit>"""
    surface, messages = surface_of(tmp_path, document(nodes, shader("surfaceshader", "S")))
    assert messages == []  # nothing refers to itself
    assert surface.emissive_color == pytest.approx((1, 2, 3))
