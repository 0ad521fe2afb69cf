"""Previews that assets name: only the default prim's assetInfo and apiSchemas of the root layer change."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pxr import Sdf, Usd, UsdMedia

from primray.errors import SceneError, StageOpenError
from primray.usd import check_preview, write_with_preview

NAME = "./thumbs/a.png"
SCHEMA = "AssetPreviewsAPI"
OTHERS = ["MotionAPI", "GeomModelAPI", SCHEMA]


def rest_of(layer: Sdf.Layer) -> str:
    """Return a layer as text, without what a preview may change."""
    copy = Sdf.Layer.CreateAnonymous(".usda")
    copy.TransferContent(layer)
    prim = copy.GetPrimAtPath(copy.GetDefaultPrimAsPath())
    info = dict(prim.GetInfo("assetInfo"))
    info.pop("previews", None)
    prim.SetInfo("assetInfo", info)
    prim.ClearInfo("apiSchemas")
    return str(copy.ExportToString())


def composed(path: Path) -> str:
    stage = Usd.Stage.Open(str(path))
    flat = stage.Flatten()
    flat.documentation = ""
    return rest_of(flat)


@st.composite
def layers(draw: st.DrawFn) -> dict[str, Any]:
    return {
        "suffix": draw(st.sampled_from([".usda", ".usdc", ".usd"])),
        "is_text": draw(st.booleans()),
        "specifier": draw(st.sampled_from([Sdf.SpecifierDef, Sdf.SpecifierOver])),
        "schemas": draw(st.lists(st.sampled_from(OTHERS), unique=True)),
        "list": draw(st.sampled_from(["explicitItems", "prependedItems", "appendedItems", "deletedItems"])),
        "info": draw(
            st.dictionaries(st.sampled_from(["name", "version", "previews"]), st.sampled_from(["x", 3, {"thumbnails": 1.5}]))
        ),
        "times": draw(st.dictionaries(st.integers(-5, 5), st.floats(-9, 9), max_size=4)),
        "nested": draw(st.booleans()),
    }


def write_layer(folder: Path, made: dict[str, Any]) -> Path:
    path = folder / f"asset{made['suffix']}"
    path.unlink(missing_ok=True)
    sub = Sdf.Layer.CreateAnonymous(".usda")
    sub.ImportFromString('#usda 1.0\ndef Xform "A" (kind = "component")\n{\n def Sphere "ball"\n {\n }\n}\n')
    sub.Export(str(folder / "sub.usda"))
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.subLayerPaths.append("./sub.usda")
    layer.customLayerData = {"who": "me"}
    prim = Sdf.CreatePrimInLayer(layer, "/A/inner" if made["nested"] else "/A")
    layer.defaultPrim = str(prim.path) if made["nested"] else "A"
    prim.specifier = made["specifier"]
    schemas = Sdf.TokenListOp()
    if made["list"] == "explicitItems":
        schemas = Sdf.TokenListOp.CreateExplicit(made["schemas"])
    else:
        setattr(schemas, made["list"], made["schemas"])
    prim.SetInfo("apiSchemas", schemas)
    if made["info"]:
        prim.SetInfo("assetInfo", made["info"])
    radius = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, "/A/ball"), "radius", Sdf.ValueTypeNames.Double)
    for time, value in made["times"].items():
        layer.SetTimeSample(radius.path, time, value)
    arguments = {"format": "usda" if made["is_text"] else "usdc"} if made["suffix"] == ".usd" else {}
    assert layer.Export(str(path), args=arguments)
    return path


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(layers())
def test_nothing_but_the_preview_changes(tmp_path: Path, made: dict[str, Any]) -> None:
    path = write_layer(tmp_path, made)
    target = tmp_path / f"made{path.suffix}"
    target.unlink(missing_ok=True)
    write_with_preview(str(path), NAME, "", str(target), str(tmp_path))
    before, after = (Sdf.Layer.OpenAsAnonymous(str(file)) for file in (path, target))
    assert rest_of(after) == rest_of(before)
    assert composed(target) == composed(path)
    assert target.read_bytes()[:8] == path.read_bytes()[:8]  # usda stays usda
    stages = [Usd.Stage.Open(str(file)) for file in (path, target)]
    was, default = (stage.GetDefaultPrim() for stage in stages)
    assert SCHEMA in default.GetAppliedSchemas()
    old, new = ([name for name in prim.GetAppliedSchemas() if name != SCHEMA] for prim in (was, default))
    assert new == old
    found = UsdMedia.AssetPreviewsAPI(default).GetDefaultThumbnails()
    assert found.defaultImage.path == NAME


def package(path: Path) -> list[str]:
    """Write a usdz whose second entry is not of an alphabetical order; return its entries."""
    folder = path.parent
    (folder / "root.usda").write_text(
        '#usda 1.0\n(\n defaultPrim = "A"\n)\ndef Xform "A" (references = @./z.usda@</B>)\n{\n}\n'
    )
    (folder / "z.usda").write_text('#usda 1.0\ndef Sphere "B"\n{\n}\n')
    (folder / "b.png").write_bytes(b"no picture" * 20)
    writer = Sdf.ZipFileWriter.CreateNew(str(path))
    names = ["root.usda", "z.usda", "b.png"]
    for name in names:
        writer.AddFile(str(folder / name), f"sub/{name}")
    writer.Save()
    return [f"sub/{name}" for name in names]


def test_a_package_keeps_its_entries_and_their_order(tmp_path: Path) -> None:
    path, picture = tmp_path / "a.usdz", tmp_path / "made.png"
    names = package(path)
    before = {name: zipfile.ZipFile(path).read(name) for name in names}
    for k, content in enumerate((b"first", b"second")):  # a second preview replaces the first
        picture.write_bytes(content)
        target, scratch = tmp_path / f"{k}.usdz", tmp_path / str(k)
        scratch.mkdir()
        write_with_preview(str(path), NAME, str(picture), str(target), str(scratch))
        with zipfile.ZipFile(target) as made:
            assert made.namelist() == [*names, "sub/thumbs/a.png"]
            assert [made.read(name) for name in names[1:]] == [before[name] for name in names[1:]]
            assert made.read("sub/thumbs/a.png") == content
            for entry in made.infolist():
                assert entry.compress_type == zipfile.ZIP_STORED
                header = target.read_bytes()[entry.header_offset : entry.header_offset + 30]
                start = entry.header_offset + 30 + sum(int.from_bytes(header[at : at + 2], "little") for at in (26, 28))
                assert start % 64 == 0, entry.filename
        path = target
    made = Usd.Stage.Open(str(path))
    assert "defaultImage" in made.GetRootLayer().ExportToString()
    assert Usd.Stage.Open(str(path)).GetPrimAtPath("/A").GetTypeName() == "Xform"
    stage = Usd.Stage.Open(str(path))
    found = UsdMedia.AssetPreviewsAPI(stage.GetDefaultPrim()).GetDefaultThumbnails()
    assert found.defaultImage.resolvedPath.endswith("[sub/thumbs/a.png]")


def test_an_asset_without_a_default_prim_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    path.write_text('#usda 1.0\ndef Sphere "s"\n{\n}\n')
    with pytest.raises(SceneError, match="names none: author defaultPrim"):
        check_preview(str(path))
    for name, content in (("b.usdz", b"no zip"), ("c.usda", b"no stage")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(StageOpenError):
            check_preview(str(tmp_path / name))
