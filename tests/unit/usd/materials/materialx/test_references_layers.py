"""Documents as layers: the layout of USD's own plugin."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Gf, Sdf, Usd, UsdShade
from tests.unit.usd.materials.materialx.documents import RED

from primray.errors import AssetError
from primray.usd.materials.materialx.references import layer_of_document


def stage_of(tmp_path: Path, text: str) -> Usd.Stage:
    (tmp_path / "looks.mtlx").write_text(text)
    return Usd.Stage.Open(layer_of_document(str(tmp_path / "looks.mtlx")))


def test_materials_have_an_interface_that_shaders_read(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, RED)
    assert stage.GetDefaultPrim().GetPath() == "/MaterialX"
    material = UsdShade.Material(stage.GetPrimAtPath("/MaterialX/Materials/Red"))
    assert material.GetPrim().GetAttribute("config:mtlx:version").Get() == "1.39"
    assert material.GetInput("base_color").Get() == Gf.Vec3f(1, 0, 0)
    shader, name, _ = material.GetSurfaceOutput("mtlx").GetConnectedSource()
    assert (shader.GetPath(), name) == ("/MaterialX/Materials/Red/SR_red", "surface")
    assert UsdShade.Shader(shader.GetPrim()).GetIdAttr().Get() == "ND_standard_surface_surfaceshader"
    given = UsdShade.Shader(shader.GetPrim()).GetInput("base_color")
    assert given.GetValueProducingAttributes()[0].GetPath() == "/MaterialX/Materials/Red.inputs:base_color"


def test_graphs_are_referred_to_inside_their_materials(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, RED)
    shader = UsdShade.Shader(stage.GetPrimAtPath("/MaterialX/Materials/Wood/SR_wood"))
    (source,) = shader.GetInput("base_color").GetValueProducingAttributes()
    assert source.GetPath() == "/MaterialX/Materials/Wood/NG/scaled.outputs:out"
    multiply = UsdShade.Shader(source.GetPrim())
    assert multiply.GetIdAttr().Get() == "ND_multiply_color3FA"
    assert multiply.GetInput("in2").GetValueProducingAttributes()[0].GetPath() == "/MaterialX/Materials/Wood/NG.inputs:scale"
    file = stage.GetAttributeAtPath("/MaterialX/NodeGraphs/NG/picture.inputs:file")
    assert file.Get().path == "maps/wood.png"  # its prefix before it
    assert file.GetColorSpace() == "srgb_texture"


def test_nodes_at_the_top_of_a_document_are_a_graph(tmp_path: Path) -> None:
    text = """<materialx version="1.39">
      <constant name="c" type="color3"><input name="value" type="color3" value="0.1, 0.2, 0.3"/></constant>
      <standard_surface name="S" type="surfaceshader">
        <input name="base_color" type="color3" nodename="c"/>
      </standard_surface>
      <surfacematerial name="M" type="material">
        <input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
    </materialx>"""
    stage = stage_of(tmp_path, text)
    given = UsdShade.Shader(stage.GetPrimAtPath("/MaterialX/Materials/M/S")).GetInput("base_color")
    assert given.GetConnectedSource()[0].GetPath() == "/MaterialX/Materials/M/NodeGraphs/c"


def test_a_node_of_the_files_own_is_its_graph(tmp_path: Path) -> None:
    text = """<materialx version="1.39">
      <nodedef name="ND_twice" node="twice"><input name="in" type="float" value="1"/><output name="out" type="float"/></nodedef>
      <nodegraph name="NG_twice" nodedef="ND_twice">
        <multiply name="m" type="float"><input name="in1" type="float" interfacename="in"/>
          <input name="in2" type="float" value="2"/></multiply>
        <output name="out" type="float" nodename="m"/>
      </nodegraph>
      <nodegraph name="G">
        <twice name="a" type="float"><input name="in" type="float" value="3"/></twice>
        <twice name="b" type="float"><input name="in" type="float" nodename="a"/></twice>
        <output name="out" type="float" nodename="b"/>
      </nodegraph>
      <standard_surface name="S" type="surfaceshader">
        <input name="coat" type="float" nodegraph="G" output="out"/></standard_surface>
      <surfacematerial name="M" type="material">
        <input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
    </materialx>"""
    stage = stage_of(tmp_path, text)
    given = UsdShade.Shader(stage.GetPrimAtPath("/MaterialX/Materials/M/S")).GetInput("coat")
    (source,) = given.GetValueProducingAttributes()
    assert source.GetPath() == "/MaterialX/Materials/M/G/b/m.outputs:out"
    inner = UsdShade.Shader(source.GetPrim()).GetInput("in1").GetValueProducingAttributes()
    assert [str(found.GetPath()) for found in inner] == ["/MaterialX/Materials/M/G/a/m.outputs:out"]
    first = UsdShade.Shader(stage.GetPrimAtPath("/MaterialX/Materials/M/G/a/m")).GetInput("in1")
    assert first.GetValueProducingAttributes()[0].Get() == 3


def test_older_versions_are_upgraded(tmp_path: Path) -> None:
    text = """<materialx version="1.37">
      <standard_surface name="S" type="surfaceshader">
        <parameter name="base" type="float" value="0.5"/></standard_surface>
      <surfacematerial name="M" type="material">
        <input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial>
    </materialx>"""
    stage = stage_of(tmp_path, text)
    assert stage.GetAttributeAtPath("/MaterialX/Materials/M.inputs:base").Get() == 0.5


def test_looks_are_variants_with_bindings(tmp_path: Path) -> None:
    look = """<collection name="all" includegeom="/a, /b"/>
      <look name="day"><materialassign name="as_red" material="Red" collection="all"/></look>
      <look name="night"><materialassign name="as_wood" material="Wood" collection="all"/></look></materialx>"""
    stage = stage_of(tmp_path, RED.replace("</materialx>", look))
    model = stage.GetPrimAtPath("/ModelRoot")
    assert model.GetVariantSet("LookVariant").GetVariantNames() == ["day", "night"]
    binding = stage.GetRelationshipAtPath("/MaterialX/Looks/day.material:binding:collection:as_red")
    assert binding.GetTargets() == [
        Sdf.Path("/MaterialX/Looks/day.collection:as_red"),
        Sdf.Path("/MaterialX/Looks/day/Materials/as_red"),
    ]


BAD = {
    "not XML": ("<materialx", "not XML"),
    "another document": ("<html></html>", "No root MaterialX element"),
    "deep": ("<materialx>" + "<nodegraph name='a'>" * 100 + "</nodegraph>" * 100 + "</materialx>", "deep"),
    "a document type": ('<!DOCTYPE a [<!ENTITY b "c">]><materialx/>', "document type"),
    "binary": ("\0\1\2", ""),
    "includes itself": ('<materialx><xi:include href="looks.mtlx"/></materialx>', "itself"),
    "includes nothing": ('<materialx><xi:include href="gone.mtlx"/></materialx>', "gone.mtlx"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_document_is_an_error_that_says_why(tmp_path: Path, case: str) -> None:
    text, why = BAD[case]
    path = tmp_path / "looks.mtlx"
    path.write_text(text)
    with pytest.raises(AssetError) as error:
        layer_of_document(str(path))
    assert why in error.value.message
    assert error.value.code == "materialx-document"


def test_includes_without_end_are_bounded(tmp_path: Path) -> None:
    both = "".join(f'<xi:include href="{i}.mtlx"/>' for i in ("{next}", "{next}"))
    for number in range(40):  # 2 ** 40 documents
        (tmp_path / f"{number}.mtlx").write_text(f"<materialx>{both.format(next=number + 1)}</materialx>")
    (tmp_path / "40.mtlx").write_text("<materialx/>")
    with pytest.raises(AssetError, match="includes more than"):
        layer_of_document(str(tmp_path / "0.mtlx"))


def doubling(depth: int, last: str) -> str:
    """Nodes of the file's own, each two of the next."""
    parts = []
    for i in range(depth):
        inner = f"n{i + 1}" if i + 1 < depth else last
        nodes = "".join(f'<{inner} name="{k}" type="float"/>' for k in ("a", "b"))
        parts.append(f'<nodedef name="ND_n{i}" node="n{i}"><output name="out" type="float"/></nodedef>')
        parts.append(
            f'<nodegraph name="NG_n{i}" nodedef="ND_n{i}">{nodes}<output name="out" type="float" nodename="a"/></nodegraph>'
        )
    return f'<materialx version="1.39">{"".join(parts)}</materialx>'


@pytest.mark.parametrize(("text", "why"), [(doubling(40, "noise2d"), "more than"), (doubling(3, "n0"), "itself")])
def test_graphs_that_grow_without_end_are_refused(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "looks.mtlx").write_text(text)
    with pytest.raises(AssetError, match=why):
        layer_of_document(str(tmp_path / "looks.mtlx"))
