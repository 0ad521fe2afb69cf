"""Stages that refer to documents: by sublayers, references and payloads, in packages and instances, and as files change."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Gf, Sdf, Usd, UsdUtils
from tests.unit.usd.materials.materialx.documents import RED, STAGE

from primray.composition import Composition
from primray.diagnostics import Diagnostics
from primray.usd import open_stage
from primray.usd.stage.metadata import layer_names
from primray.usd.stage.open import reload_layers


def folder(tmp_path: Path, stage: str = STAGE) -> str:
    (tmp_path / "looks.mtlx").write_text(RED)
    (tmp_path / "scene.usda").write_text(stage)
    return str(tmp_path / "scene.usda")


def color_at(stage: Usd.Stage, path: str) -> Gf.Vec3f | None:
    attribute = stage.GetAttributeAtPath(f"{path}.inputs:base_color")
    return attribute.Get() if attribute else None


def opened(path: str | Usd.Stage, composition: Composition | None = None) -> Usd.Stage:
    diagnostics = Diagnostics()
    stage = open_stage(path, diagnostics, composition or Composition())
    assert [d.message for d in diagnostics if d.severity.value != "info"] == []
    return stage


ARCS = {
    "a reference": ("references = @looks.mtlx@</MaterialX/Materials/Red>", "/a"),
    "a reference to the default prim": ("references = @./looks.mtlx@", "/a/Materials/Red"),
    "a payload": ("payload = @looks.mtlx@</MaterialX/Materials/Red>", "/a"),
    "a variant": (
        'variantSets = "v"\n variants = { string v = "one" }\n ) { variantSet "v" = {\n"one" (\n'
        'references = @looks.mtlx@</MaterialX/Materials/Red>\n) { }\n}\n}\ndef "b" (',
        "/a",
    ),
}


@pytest.mark.parametrize("arc", ARCS)
def test_arcs_to_documents_compose(tmp_path: Path, arc: str) -> None:
    text, path = ARCS[arc]
    stage = opened(folder(tmp_path, f'#usda 1.0\ndef "a" ( {text} ) {{ }}\n'))
    assert color_at(stage, path) == Gf.Vec3f(1, 0, 0)


def test_sublayers_compose(tmp_path: Path) -> None:
    stage = opened(folder(tmp_path, "#usda 1.0\n( subLayers = [@looks.mtlx@] )\n"))
    assert color_at(stage, "/MaterialX/Materials/Red") == Gf.Vec3f(1, 0, 0)


def test_layers_between_are_copied_and_told_by_their_own_names(tmp_path: Path) -> None:
    folder(tmp_path)
    os.mkdir(tmp_path / "shots")
    (tmp_path / "shots" / "shot.usda").write_text(
        '#usda 1.0\n( subLayers = [@over.usda@] )\ndef "w" ( references = @../scene.usda@ ) {\n asset texture = @t.png@\n}\n'
    )
    (tmp_path / "shots" / "over.usda").write_text("#usda 1.0\n")
    stage = opened(str(tmp_path / "shots" / "shot.usda"))
    assert color_at(stage, "/w/Looks/Red") == Gf.Vec3f(1, 0, 0)
    names = [os.path.relpath(name, tmp_path) for name in layer_names(stage)]
    assert sorted(names) == ["looks.mtlx", "scene.usda", "shots/over.usda", "shots/shot.usda"]
    assert not any(layer.dirty for layer in Sdf.Layer.GetLoadedLayers() if layer.identifier.endswith("/scene.usda"))


def test_relative_paths_lead_where_they_did(tmp_path: Path) -> None:
    os.mkdir(tmp_path / "maps")
    (tmp_path / "maps" / "wood.png").write_bytes(b"a picture")
    stage = opened(folder(tmp_path))
    file = stage.GetAttributeAtPath("/World/Looks/Wood/NG/picture.inputs:file").Get()
    assert file.resolvedPath == str(tmp_path / "maps" / "wood.png")


def test_native_instances_share_their_prototype(tmp_path: Path) -> None:
    folder(tmp_path)
    instances = "".join(f'def "i{n}" (\n instanceable = true\n references = @scene.usda@\n) {{ }}\n' for n in range(3))
    (tmp_path / "many.usda").write_text("#usda 1.0\n" + instances)
    stage = opened(str(tmp_path / "many.usda"))
    (prototype,) = stage.GetPrototypes()
    assert color_at(stage, f"{prototype.GetPath()}/Looks/Red") == Gf.Vec3f(1, 0, 0)


def test_documents_in_packages(tmp_path: Path) -> None:
    os.mkdir(tmp_path / "maps")
    (tmp_path / "maps" / "wood.png").write_bytes(b"a picture")
    folder(tmp_path)
    package = str(tmp_path / "scene.usdz")
    with Sdf.ZipFileWriter.CreateNew(package) as writer:
        for name in ("scene.usda", "looks.mtlx", "maps/wood.png"):
            writer.AddFile(str(tmp_path / name), name)
    for name in ("scene.usda", "looks.mtlx", "maps/wood.png"):
        os.remove(tmp_path / name)
    stage = opened(package)
    assert color_at(stage, "/World/Looks/Red") == Gf.Vec3f(1, 0, 0)
    file = stage.GetAttributeAtPath("/World/Looks/Wood/NG/picture.inputs:file").Get()
    assert file.resolvedPath == f"{package}[maps/wood.png]"


def test_variants_that_a_document_brings_can_be_chosen(tmp_path: Path) -> None:
    look = '<look name="day"><materialassign name="r" material="Red"/></look><look name="night"/></materialx>'
    path = folder(tmp_path, '#usda 1.0\ndef "a" ( references = @looks.mtlx@</ModelRoot> ) { }\n')
    (tmp_path / "looks.mtlx").write_text(RED.replace("</materialx>", look))
    stage = opened(path, Composition(variants=("/a:LookVariant=day",)))
    assert stage.GetRelationshipAtPath("/a.material:binding")
    stage = opened(path, Composition(variants=("/a:LookVariant=night",)))
    assert not stage.GetRelationshipAtPath("/a.material:binding")


def test_stages_in_memory_compose_too_and_stay_as_they_are(tmp_path: Path) -> None:
    folder(tmp_path)
    stage = Usd.Stage.CreateInMemory()
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    stage.DefinePrim("/a").GetReferences().AddReference(str(tmp_path / "looks.mtlx"), "/MaterialX/Materials/Red")
    before = stage.GetRootLayer().ExportToString()
    made = opened(stage)
    assert color_at(made, "/a") == Gf.Vec3f(1, 0, 0)
    assert stage.GetRootLayer().ExportToString() == before
    delegate.TakeUncoalescedDiagnostics()


def test_documents_that_cannot_be_read_are_told_and_the_rest_goes_on(tmp_path: Path) -> None:
    text = '#usda 1.0\ndef "a" ( references = @bad.mtlx@</MaterialX> ) { }\ndef "b" ( references = @looks.mtlx@ ) { }\n'
    path = folder(tmp_path, text)
    (tmp_path / "bad.mtlx").write_text("<materialx")
    diagnostics = Diagnostics()
    stage = open_stage(path, diagnostics)
    assert [d.code for d in diagnostics] == ["materialx-document", "composition-error"]
    assert next(iter(diagnostics)).message.startswith("bad.mtlx: it is not XML")
    assert color_at(stage, "/b/Materials/Red") == Gf.Vec3f(1, 0, 0)


def test_changed_files_are_read_anew_in_their_places(tmp_path: Path) -> None:
    path = folder(tmp_path)
    stage = opened(path)
    (tmp_path / "looks.mtlx").write_text(RED.replace("1, 0, 0", "0, 1, 0"))
    reload_layers(path, {str(tmp_path / "looks.mtlx")})
    assert color_at(stage, "/World/Looks/Red") == Gf.Vec3f(0, 1, 0)
    (tmp_path / "scene.usda").write_text(STAGE.replace("ball", "sphere"))
    reload_layers(path, {path})
    assert stage.GetPrimAtPath("/World/sphere")
    assert color_at(stage, "/World/Looks/Red") == Gf.Vec3f(0, 1, 0)


def test_stages_without_documents_do_not_import_the_package(tmp_path: Path) -> None:
    (tmp_path / "scene.usda").write_text('#usda 1.0\ndef Sphere "s" { }\n')
    code = (
        "import sys; from primray.usd import open_stage, translate; from primray.diagnostics import Diagnostics; "
        "from primray.settings import RenderSettings; "
        f"translate(open_stage({str(tmp_path / 'scene.usda')!r}, Diagnostics()), RenderSettings()); "
        "print('MaterialX' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"
