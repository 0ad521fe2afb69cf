"""Colours of documents are in the space of the nearest scope that names one, whoever includes or refers to the document."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf
from tests.unit.usd.materials.materialx.documents import DEFAULTS, QUAD, surface_of, unlit

from primray.color.color_space import ACESCG, REC709, converted
from primray.description import TextureFile, TextureInput
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import open_stage, translate
from primray.usd.materials.materialx.documents import library
from primray.usd.materials.materialx.references import layer_of_document

RGB = "0.8, 0.1, 0.2"
AS_WRITTEN = (0.8, 0.1, 0.2)
IN_ACESCG = tuple(converted(np.array(AS_WRITTEN), ACESCG, REC709))


def emitted(folder: Path, document: str, settings: RenderSettings = DEFAULTS) -> tuple[float, ...]:
    surface, messages = surface_of(folder, document, settings=settings)
    assert messages == []
    return surface.emissive_color


def constant(attributes: str = "") -> str:
    return f'<constant name="c" type="color3"><input name="value" type="color3" value="{RGB}" {attributes}/></constant>'


GRAPH = f"""<nodegraph name="G" {{graph}}><input name="tint" type="color3" value="{RGB}" {{interface}}/>
  <constant name="k" type="color3"><input name="value" type="color3" interfacename="tint"/></constant>
  <output name="out" type="color3" nodename="k"/></nodegraph>"""
OWN = f"""<nodedef name="ND_own" node="own" {{definition}}>
    <input name="tint" type="color3" value="{RGB}" {{default}}/><output name="out" type="color3"/></nodedef>
  <nodegraph name="NG_own" nodedef="ND_own"><constant name="k" type="color3">
    <input name="value" type="color3" interfacename="tint"/></constant>
    <output name="out" type="color3" nodename="k"/></nodegraph>
  <own name="c" type="color3" {{node}}>{{given}}</own>"""
SAID = f'<input name="tint" type="color3" value="{RGB}" {{}}/>'
ACES, LINEAR = 'colorspace="acescg"', 'colorspace="lin_rec709"'

# Documents, and whether what they emit is converted from ACEScg.
SCOPES = {
    "the document's": (unlit(constant(), ACES), True),
    "an input's": (unlit(constant(ACES), LINEAR), True),
    "an input's, against the document's": (unlit(constant(LINEAR), ACES), False),
    "an input's, which is also the document's": (unlit(constant(ACES), ACES), True),
    "a node's": (unlit(constant().replace("<constant", f"<constant {ACES}"), LINEAR), True),
    "none": (unlit(constant('colorspace="none"'), ACES), False),
    "nobody's": (unlit(constant()), False),
    "a shader's input": (unlit("", ACES, f'value="{RGB}"'), True),
    "a shader's input, said": (unlit("", LINEAR, f'value="{RGB}" {ACES}'), True),
    "a graph's": (unlit(GRAPH.format(graph=ACES, interface=""), LINEAR, 'nodegraph="G"'), True),
    "an interface's": (unlit(GRAPH.format(graph="", interface=ACES), LINEAR, 'nodegraph="G"'), True),
    "a default's": (unlit(OWN.format(definition="", default=ACES, node="", given=""), LINEAR), True),
    "a definition's": (unlit(OWN.format(definition=ACES, default="", node="", given=""), LINEAR), True),
    "what is given, not the default's": (
        unlit(OWN.format(definition="", default=ACES, node="", given=SAID.format("")), LINEAR),
        False,
    ),
    "what is given": (unlit(OWN.format(definition="", default="", node="", given=SAID.format(ACES)), LINEAR), True),
}


@pytest.mark.parametrize("scope", SCOPES)
def test_the_nearest_scope_says_the_space(scope: str, tmp_path: Path) -> None:
    document, is_converted = SCOPES[scope]
    assert emitted(tmp_path, document) == pytest.approx(IN_ACESCG if is_converted else AS_WRITTEN, abs=1e-6)


def test_nothing_is_converted_where_no_space_is_named_whatever_the_rendering_space(tmp_path: Path) -> None:
    rendered = RenderSettings(rendering_color_space="lin_ap1_scene")
    assert emitted(tmp_path, unlit(constant()), rendered) == pytest.approx(AS_WRITTEN, abs=1e-6)
    assert emitted(tmp_path, unlit(constant(), ACES), rendered) == pytest.approx(AS_WRITTEN, abs=1e-6)
    assert emitted(tmp_path, unlit(constant(), LINEAR), rendered) != pytest.approx(AS_WRITTEN, abs=1e-3)


def test_vectors_are_not_converted(tmp_path: Path) -> None:
    nodes = f"""<constant name="v" type="vector3"><input name="value" type="vector3" value="{RGB}"/></constant>
      <convert name="c" type="color3"><input name="in" type="vector3" nodename="v"/></convert>"""
    assert emitted(tmp_path, unlit(nodes, ACES)) == pytest.approx(AS_WRITTEN, abs=1e-6)


def transforms() -> list[str]:
    """Return the spaces that MaterialX's library has transforms from."""
    names = [d.getName() for d in library().getNodeDefs() if d.getName().endswith("_to_lin_rec709_color3")]
    return [name.removeprefix("ND_").removesuffix("_to_lin_rec709_color3") for name in names]


def in_rec709(space: str, rgb: np.ndarray) -> np.ndarray:
    """Return what the library's transform from a space makes of a colour, by the steps of its graph."""
    if space == "srgb_texture":  # IEC 61966-2-1, which the library has as a graph of comparisons
        return np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    for node in library().getNodeGraph(f"NG_{space}_to_lin_rec709_color3").getNodes():
        category = node.getCategory()
        if category == "power":
            rgb = rgb ** float(node.getInput("in2").getValueString() or 563 / 256)  # Adobe's, a quotient there
        elif category == "transformmatrix":
            text = node.getParent().getNode("mat").getInput("value").getValueString()
            rgb = rgb @ np.array([float(x) for x in text.split(",")]).reshape(3, 3)
        elif category.endswith("_to_lin_rec709"):
            rgb = in_rec709(category.removesuffix("_to_lin_rec709"), rgb)
    return rgb


@pytest.mark.parametrize("space", transforms())
def test_spaces_are_those_of_materialx_own_transforms(space: str, tmp_path: Path) -> None:
    wanted = np.maximum(in_rec709(space, np.array(AS_WRITTEN)), 0)  # no light is negative
    assert emitted(tmp_path, unlit(constant(), f'colorspace="{space}"')) == pytest.approx(tuple(wanted), abs=2e-3)


@pytest.mark.parametrize("space", ["lin_rec709", "lin_ap1", "lin_srgb", "g18_ap1"])
def test_the_other_names_of_the_specification_are_known(space: str, tmp_path: Path) -> None:
    assert emitted(tmp_path, unlit(constant(), f'colorspace="{space}"'))[0] > 0  # and no message


def test_a_space_that_nobody_knows_is_reported(tmp_path: Path) -> None:
    _, messages = surface_of(tmp_path, unlit(constant(), 'colorspace="no_such_space"'))
    assert ["no_such_space" in message for message in messages] == [True]


INCLUDED = {  # attributes of the includer, of the included document, and whether its colours are converted
    "it keeps its space": (LINEAR, ACES, True),
    "it has none of its includer's": (ACES, "", False),
    "neither has one": ("", "", False),
}


@pytest.mark.parametrize("case", INCLUDED)
def test_an_included_document_means_what_it_means_alone(case: str, tmp_path: Path) -> None:
    above, own, is_converted = INCLUDED[case]
    (tmp_path / "part.mtlx").write_text(unlit(constant(), own))
    surface, _ = surface_of(tmp_path, f'<materialx version="1.39" {above}><xi:include href="part.mtlx"/></materialx>')
    assert surface.emissive_color == pytest.approx(IN_ACESCG if is_converted else AS_WRITTEN, abs=1e-6)


def test_prefixes_of_an_includer_are_not_those_of_what_it_includes(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    for folder in ("maps/", ""):
        (tmp_path / f"{folder}a.png").write_bytes(b"")
    (tmp_path / "part.mtlx").write_text(unlit(image("color3", ""), "", 'nodename="i"'))
    head = '<materialx version="1.39" fileprefix="maps/" geomprefix="/elsewhere">'
    (tmp_path / "looks.mtlx").write_text(f'{head}<xi:include href="part.mtlx"/></materialx>')
    layer = layer_of_document(str(tmp_path / "looks.mtlx"))
    assert layer.GetAttributeAtPath("/MaterialX/NodeGraphs/i.inputs:file").default.path == "a.png"


def test_a_stage_has_no_say_in_a_documents_colours(tmp_path: Path) -> None:
    (tmp_path / "looks.mtlx").write_text(unlit(constant(), LINEAR))
    (tmp_path / "stage.usda").write_text(
        QUAD.format(document="looks.mtlx", meters=1)
        .replace("( references", '(\nprepend apiSchemas = ["ColorSpaceAPI"]\nreferences')
        .replace("{}", '{\nuniform token colorSpace:name = "lin_ap1_scene"\n}')
    )
    description, _ = translate(open_stage(tmp_path / "stage.usda", Diagnostics()), DEFAULTS)
    assert description.surfaces[0].emissive_color == pytest.approx(AS_WRITTEN, abs=1e-6)


def test_a_document_in_a_package_means_the_same(tmp_path: Path) -> None:
    wanted = emitted(tmp_path, unlit(constant(), ACES))
    package = str(tmp_path / "all.usdz")
    with Sdf.ZipFileWriter.CreateNew(package) as writer:
        for name in ("stage.usda", "looks.mtlx"):
            writer.AddFile(str(tmp_path / name), name)
    description, _ = translate(open_stage(package, Diagnostics()), DEFAULTS)
    assert description.surfaces[0].emissive_color == wanted


def image(kind: str, attributes: str, file: str = 'value="a.png"') -> str:
    return f'<image name="i" type="{kind}"><input name="file" type="filename" {file} {attributes}/></image>'


def file_read(folder: Path, document: str) -> TextureFile:
    surface, _ = surface_of(folder, document)
    nodes = surface.pattern.nodes if surface.pattern else ()
    of_nodes = [value for node in nodes for _, value in node.inputs if isinstance(value, TextureFile)]
    (read,) = [value.file for _, value in surface.inputs if isinstance(value, TextureInput)] + of_nodes
    return read


FILES = {
    "said": (unlit(image("color3", LINEAR).replace('"i"', '"c"'), LINEAR), "raw"),
    "the document's": (unlit(image("color3", "").replace('"i"', '"c"'), 'colorspace="srgb_texture"'), "sRGB"),
    "nobody's": (unlit(image("color3", "").replace('"i"', '"c"')), "raw"),
    "of numbers": (
        unlit(
            image("float", 'colorspace="srgb_texture"')
            + '<convert name="c" type="color3"><input name="in" type="float" nodename="i"/></convert>',
            'colorspace="srgb_texture"',
        ),
        "raw",
    ),
    "an interface's": (
        unlit(
            '<nodegraph name="G"><input name="f" type="filename" value="a.png" colorspace="srgb_texture"/>'
            + image("color3", "", 'interfacename="f"')
            + '<output name="out" type="color3" nodename="i"/></nodegraph>',
            LINEAR,
            'nodegraph="G"',
        ),
        "sRGB",
    ),
    "an interface's, of numbers": (
        unlit(
            '<nodegraph name="G"><input name="f" type="filename" value="a.png" colorspace="srgb_texture"/>'
            + image("float", "", 'interfacename="f"')
            + image("color3", "", 'interfacename="f"').replace('"i"', '"other"')
            + '<convert name="k" type="color3"><input name="in" type="float" nodename="i"/></convert>'
            + '<output name="out" type="color3" nodename="k"/></nodegraph>',
            LINEAR,
            'nodegraph="G"',
        ),
        "raw",
    ),
}


@pytest.mark.parametrize("case", FILES)
def test_files_of_colours_are_in_a_space_and_others_are_not(case: str, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"")
    document, space = FILES[case]
    assert file_read(tmp_path, document).color_space == space


def test_files_of_an_included_document_lie_beside_it(tmp_path: Path) -> None:
    (tmp_path / "part" / "maps").mkdir(parents=True)
    (tmp_path / "part" / "maps" / "a.png").write_bytes(b"")
    (tmp_path / "top.png").write_bytes(b"")
    nodes = image("color3", "") + image("color3", "", 'value="top.png" fileprefix=""').replace('"i"', '"j"')
    (tmp_path / "part" / "part.mtlx").write_text(unlit(nodes, 'fileprefix="maps/"', 'nodename="i"'))
    (tmp_path / "looks.mtlx").write_text('<materialx version="1.39"><xi:include href="part/part.mtlx"/></materialx>')
    layer = layer_of_document(str(tmp_path / "looks.mtlx"))
    files = [layer.GetAttributeAtPath(f"/MaterialX/NodeGraphs/{name}.inputs:file").default.path for name in "ij"]
    assert files == ["part/maps/a.png", "top.png"]  # what lies beside the includer alone is found there


@pytest.mark.parametrize("kind", ["geompropvalue", "geomcolor"])
@pytest.mark.parametrize("at", ["node", "input", "document"])
def test_the_color_space_of_a_geometric_property_is_reported(tmp_path: Path, kind: str, at: str) -> None:
    own = {where: f" {ACES}" if where == at else "" for where in ("node", "input", "document")}
    name = ("geomprop", "string", "tint") if kind == "geompropvalue" else ("index", "integer", "0")
    given = '<input name="{}" type="{}" value="{}"{}/>'.format(*name, own["input"] if kind == "geompropvalue" else "")
    node = f'<{kind} name="c" type="color3"{own["node"]}>{given}</{kind}>'
    _, messages = surface_of(tmp_path, unlit(node, own["document"]))
    is_said = at == "node" or (at == "input" and kind == "geompropvalue")
    assert any("has the colour space 'acescg'" in message for message in messages) is is_said
