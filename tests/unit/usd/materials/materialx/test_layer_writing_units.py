"""Values of documents in units: converted to what their node expects, else to the unit of the stage."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from tests.unit.usd.materials.materialx.documents import surface_of, unlit

from primray.description import TextureInput
from primray.usd.materials.materialx.documents import library

GREY = '<convert name="c" type="color3"><input name="in" type="float" nodename="v"/></convert>'
TURNED = """<texcoord name="uv" type="vector2"/>
  <rotate2d name="r" type="vector2"><input name="in" type="vector2" nodename="uv"/>{amount}</rotate2d>
  <separate2 name="s" type="multioutput"><input name="in" type="vector2" nodename="r"/></separate2>
  <convert name="c" type="color3"><input name="in" type="float" nodename="s" output="outy"/></convert>"""


def computed_with(
    folder: Path, nodes: str, category: str, name: str, meters: float = 1.0, given: str = 'nodename="c"'
) -> float:
    """Return the number that a node of the material's pattern has for an input."""
    surface, messages = surface_of(folder, unlit(nodes, given=given), meters)
    assert messages == []
    assert surface.pattern is not None
    (value,) = [dict(node.inputs)[name] for node in surface.pattern.nodes if node.category == category]
    assert isinstance(value, tuple)
    return value[0]


def emitted(folder: Path, nodes: str, meters: float = 1.0, given: str = 'nodename="c"') -> float:
    surface, messages = surface_of(folder, unlit(nodes, given=given), meters)
    assert messages == []
    return surface.emissive_color[0]


def constant(attributes: str, value: str = "2") -> str:
    return f'<constant name="v" type="float"><input name="value" type="float" value="{value}" {attributes}/></constant>{GREY}'


def defined() -> list[tuple[str, str, float]]:
    """Return the units of the library: type, name and scale."""
    return [
        (definition.getAttribute("unittype"), unit.getName(), float(unit.getAttribute("scale")))
        for definition in library().getUnitDefs()
        for unit in definition.getUnits()
    ]


@pytest.mark.parametrize(("kind", "unit", "scale"), defined())
@pytest.mark.parametrize("meters", [1.0, 0.01])
def test_every_unit_of_the_library_is_converted_to_the_scenes(
    kind: str, unit: str, scale: float, meters: float, tmp_path: Path
) -> None:
    size = meters if kind == "distance" else 1.0
    found = emitted(tmp_path, constant(f'unittype="{kind}" unit="{unit}"'), meters)
    assert found == pytest.approx(2 * scale / size, rel=1e-6)


QUARTER = f"{math.pi / 2:.9f}"
AMOUNTS = {
    "its unit, of its definition's type": f'<input name="amount" type="float" value="{QUARTER}" unit="radian"/>',
    "its definition's unit": '<input name="amount" type="float" value="90"/>',
    "the same said": '<input name="amount" type="float" value="90" unittype="angle" unit="degree"/>',
}


@pytest.mark.parametrize("case", AMOUNTS)
def test_an_input_is_converted_to_what_its_definition_expects(case: str, tmp_path: Path) -> None:
    assert computed_with(tmp_path, TURNED.format(amount=AMOUNTS[case]), "rotate2d", "amount") == pytest.approx(90)


def test_what_is_connected_is_converted_too(tmp_path: Path) -> None:
    angle = f'<constant name="a" type="float"><input name="value" type="float" value="{QUARTER}"/></constant>'
    amount = '<input name="amount" type="float" nodename="a" unittype="angle" unit="radian"/>'
    assert computed_with(tmp_path, angle + TURNED.format(amount=amount), "rotate2d", "amount") == pytest.approx(90)


GRAPH = (
    '<nodegraph name="G"><input name="a" type="float" {a}/>{nodes}<output name="out" type="color3" nodename="c"/></nodegraph>'
)
INTERFACES = {
    "converted for who reads it": (f'value="{QUARTER}" unittype="angle" unit="radian"', 'interfacename="a"'),
    "read in the unit that the reader says": (f'value="{QUARTER}"', 'interfacename="a" unit="radian"'),
    "both say it": (f'value="{QUARTER}" unittype="angle" unit="radian"', 'interfacename="a" unit="radian"'),
}


@pytest.mark.parametrize("case", INTERFACES)
def test_values_of_a_graphs_interface_are_converted(case: str, tmp_path: Path) -> None:
    outer, inner = INTERFACES[case]
    nodes = TURNED.format(amount=f'<input name="amount" type="float" {inner}/>')
    graph = GRAPH.format(a=outer, nodes=nodes)
    assert computed_with(tmp_path, graph, "rotate2d", "amount", given='nodegraph="G"') == pytest.approx(90)


def test_a_node_of_the_documents_own_gets_what_its_definition_expects(tmp_path: Path) -> None:
    nodes = """<nodedef name="ND_own" node="own"><input name="d" type="float" value="7" unittype="distance" unit="centimeter"/>
        <output name="out" type="float"/></nodedef>
      <nodegraph name="NG_own" nodedef="ND_own"><multiply name="m" type="float">
        <input name="in1" type="float" interfacename="d"/><input name="in2" type="float" value="10"/></multiply>
        <output name="out" type="float" nodename="m"/></nodegraph>"""
    default = '<own name="v" type="float"/>'
    given = '<own name="v" type="float"><input name="d" type="float" value="1" unit="inch"/></own>'
    assert emitted(tmp_path, nodes + default + GREY, 1.0) == pytest.approx(70)
    assert emitted(tmp_path, nodes + given + GREY, 1.0) == pytest.approx(25.4)


def test_a_document_may_define_units(tmp_path: Path) -> None:
    nodes = """<unitdef name="UD" unittype="distance"><unit name="cubit" scale="0.5"/></unitdef>
      <unittypedef name="time"/><unitdef name="UT" unittype="time"><unit name="s"/><unit name="min" scale="60"/></unitdef>"""
    assert emitted(tmp_path, nodes + constant('unittype="distance" unit="cubit"'), 0.01) == pytest.approx(100)
    assert emitted(tmp_path, nodes + constant('unittype="time" unit="min"')) == pytest.approx(120)


def test_numbers_of_a_file_are_converted_and_the_default_has_its_own_unit(tmp_path: Path) -> None:
    file = '<input name="file" type="filename" value="" unittype="distance" unit="centimeter"/>'
    default = '<input name="default" type="float" value="0.5" {}/>'
    other = 'unittype="distance" unit="millimeter"'
    for unit, wanted in (("", 0.5), (other, 0.0005)):
        nodes = f'<image name="v" type="float">{file}{default.format(unit)}</image>{GREY}'
        surface, _ = surface_of(tmp_path, unlit(nodes))
        assert surface.emissive_color[0] == pytest.approx(wanted, rel=1e-6)
    (tmp_path / "a.png").write_bytes(b"")
    named = file.replace('value=""', 'value="a.png"')
    nodes = f'<image name="v" type="float">{named}</image>{GREY}'
    surface, messages = surface_of(tmp_path, unlit(nodes))
    assert messages == []
    ((_, reads),) = surface.inputs
    assert isinstance(reads, TextureInput)
    assert reads.scale[0] == pytest.approx(0.01)


def test_geometric_properties_have_units(tmp_path: Path) -> None:
    nodes = f"""<geompropdef name="tall" type="float" unittype="distance" unit="foot"/>
      <geompropvalue name="v" type="float"><input name="geomprop" type="string" value="tall"/></geompropvalue>{GREY}"""
    assert computed_with(tmp_path, nodes, "multiply", "in2", 0.01) == pytest.approx(30.48)


WRONG = {
    "no type": ('unit="meter"', "unittype"),
    "an unknown unit": ('unittype="distance" unit="furlong"', "furlong"),
    "of another type": ('unittype="distance" unit="degree"', "degree"),
    "an unknown type": ('unittype="loudness" unit="sone"', "loudness"),
}


@pytest.mark.parametrize("case", WRONG)
def test_units_without_a_meaning_are_reported_and_nothing_is_converted(case: str, tmp_path: Path) -> None:
    attributes, word = WRONG[case]
    surface, messages = surface_of(tmp_path, unlit(constant(attributes)))
    assert surface.emissive_color[0] == 2
    assert [word in message for message in messages] == [True]


def test_another_type_than_the_definitions_is_reported(tmp_path: Path) -> None:
    amount = '<input name="amount" type="float" value="90" unittype="distance" unit="meter"/>'
    _, messages = surface_of(tmp_path, unlit(TURNED.format(amount=amount)))
    assert ["distance" in message and "angle" in message for message in messages] == [True]


def test_units_of_materials_that_are_not_used_are_nobodys_business(tmp_path: Path) -> None:
    other = """<nodegraph name="X">
      <constant name="k" type="color3"><input name="value" type="color3" value="1,1,1" unit="mile"/></constant>
      <output name="out" type="color3" nodename="k"/></nodegraph>
      <surface_unlit name="T" type="surfaceshader"><input name="emission_color" type="color3" nodegraph="X"/></surface_unlit>
      <surfacematerial name="N" type="material">
        <input name="surfaceshader" type="surfaceshader" nodename="T"/></surfacematerial>"""
    _, messages = surface_of(tmp_path, unlit(other, given='value="1, 1, 1"'))
    assert messages == []
