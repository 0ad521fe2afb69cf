"""What graphs of a document's own nodes have by default: geometric properties, and tokens in names of files."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.unit.usd.materials.materialx.documents import surface_of, unlit

from primray.description import TextureFile, TextureInput
from primray.usd.materials.materialx.documents import files_of_documents

CUSTOM = """<geompropdef name="second" type="vector2" geomprop="texcoord" index="1"/>
  <geompropdef name="here" type="vector3" geomprop="position" space="world"/>
  <geompropdef name="tint" type="vector3"/>
  <nodedef name="ND_base" node="base"><input name="v" type="{kind}" {default}/></nodedef>
  <nodedef name="ND_shown" node="shown" {inherit}><output name="out" type="color3"/></nodedef>
  <nodegraph name="NG_shown" nodedef="ND_shown"><convert name="w" type="color3">
    <input name="in" type="{kind}" interfacename="v"/></convert><output name="out" type="color3" nodename="w"/></nodegraph>
  {node}"""
PLAIN = '<shown name="c" type="color3"/>'
TEXTURE = '<image name="i" type="color3"><input name="file" type="filename" value="[where]/[which].png"/></image>'
SHOWS = f"""<nodedef name="ND_shown" node="shown"><token name="which" type="string" value="a"/>
  <token name="where" type="string" value="maps"/><output name="out" type="color3"/></nodedef>
  <nodegraph name="NG_shown" nodedef="ND_shown">{TEXTURE}<output name="out" type="color3" nodename="i"/></nodegraph>"""


def custom(default: str, kind: str = "vector3", node: str = PLAIN, inherit: str = 'inherit="ND_base"') -> str:
    return unlit(CUSTOM.format(default=default, kind=kind, node=node, inherit=inherit))


def read_by(folder: Path, document: str) -> list[tuple[str, dict[str, object]]]:
    """Return the nodes of what the material emits, and what each is given."""
    surface, messages = surface_of(folder, document)
    assert messages == []
    assert surface.pattern is not None
    return [(node.category, dict(node.inputs)) for node in surface.pattern.nodes]


@pytest.mark.parametrize(
    ("name", "category", "given"),
    [
        ("Nworld", "normal", {"space": "world"}),
        ("Nobject", "normal", {"space": "object"}),
        ("Tworld", "tangent", {"space": "world"}),
        ("Pworld", "position", {"space": "world"}),
        ("here", "position", {"space": "world"}),
        ("tint", "geompropvalue", {"geomprop": "tint"}),
        ("nobody", "geompropvalue", {"geomprop": "nobody"}),
    ],
)
def test_an_input_has_the_property_that_its_definition_names(
    name: str, category: str, given: dict[str, str], tmp_path: Path
) -> None:
    nodes = dict(read_by(tmp_path, custom(f'defaultgeomprop="{name}"')))
    assert given.items() <= nodes[category].items()


def test_a_value_or_a_connection_of_the_node_comes_first(tmp_path: Path) -> None:
    valued = '<shown name="c" type="color3"><input name="v" type="vector3" value="0.25, 0.5, 1"/></shown>'
    surface, _ = surface_of(tmp_path, custom('defaultgeomprop="Pworld"', node=valued))
    assert surface.emissive_color == pytest.approx((0.25, 0.5, 1))
    fed = '<normal name="n" type="vector3"/><shown name="c" type="color3"><input name="v" type="vector3" nodename="n"/></shown>'
    assert {"position"}.isdisjoint(dict(read_by(tmp_path, custom('defaultgeomprop="Pworld"', node=fed))))


def test_a_name_of_the_documents_own_is_no_primvars(tmp_path: Path) -> None:
    """geompropvalue reads what the geompropdef derives from the geometry, in a graph by its interface too."""
    nodes = """<nodegraph name="G"><input name="p" type="string" value="here"/><geompropvalue name="v" type="vector3">
      <input name="geomprop" type="string" {given}/></geompropvalue><convert name="w" type="color3">
      <input name="in" type="vector3" nodename="v"/></convert><output name="out" type="color3" nodename="w"/></nodegraph>"""
    for given in ('value="here"', 'interfacename="p"'):
        document = unlit(
            CUSTOM.format(default="", kind="vector3", node=nodes.format(given=given), inherit=""), given='nodegraph="G"'
        )
        assert dict(read_by(tmp_path, document))["position"]["space"] == "world"


def files_of(folder: Path, nodes: str, given: str = 'nodename="c"') -> list[str]:
    (folder / "maps").mkdir(exist_ok=True)
    for name in ("a", "b"):
        (folder / "maps" / f"{name}.png").write_bytes(b"")
    surface, messages = surface_of(folder, unlit(SHOWS + nodes, given=given))
    assert messages == []
    found = surface.pattern.nodes if surface.pattern else ()
    named = [v for n in found for _, v in n.inputs if isinstance(v, TextureFile)]
    named += [i.file for _, i in surface.inputs if isinstance(i, TextureInput)]
    return [Path(file.path).name for file in named]


def test_tokens_of_a_node_fill_in_names_of_files(tmp_path: Path) -> None:
    b = '<shown name="c" type="color3"><token name="which" type="string" value="b"/></shown>'
    assert files_of(tmp_path, '<shown name="c" type="color3"/>') == ["a.png"]
    assert files_of(tmp_path, b) == ["b.png"]
    fed = '<input name="in1" type="color3" nodename="d"/><input name="in2" type="color3" nodename="e"/>'
    both = '<shown name="d" type="color3"/>' + b.replace('"c"', '"e"') + f'<add name="c" type="color3">{fed}</add>'
    assert sorted(files_of(tmp_path, both)) == ["a.png", "b.png"]


def test_tokens_are_handed_on_by_what_is_around_a_node(tmp_path: Path) -> None:
    outer = """<nodedef name="ND_outer" node="outer"><token name="t" type="string" value="a"/><output name="out" type="color3"/>
      </nodedef><nodegraph name="NG_outer" nodedef="ND_outer"><shown name="s" type="color3">
      <token name="which" type="string" interfacename="t"/></shown>
      <output name="out" type="color3" nodename="s"/></nodegraph>"""
    assert files_of(tmp_path, outer + '<outer name="c" type="color3"><token name="t" type="string" value="b"/></outer>') == [
        "b.png"
    ]
    plain = '<nodegraph name="G"><shown name="s" type="color3"><token name="which" type="string" value="b"/></shown>'
    assert files_of(tmp_path, plain + '<output name="out" type="color3" nodename="s"/></nodegraph>', 'nodegraph="G"') == [
        "b.png"
    ]


def test_files_that_tokens_of_nodes_name_are_files_of_the_document(tmp_path: Path) -> None:
    files_of(tmp_path, '<shown name="c" type="color3"><token name="which" type="string" value="b"/></shown>')
    found, missing = files_of_documents([str(tmp_path / "looks.mtlx")])
    assert {Path(p).name for p in found} == {"a.png", "b.png"}
    assert missing == set()
