"""Variants, payloads, masks and session layers: what they change, what they leave alone, and what they say when they cannot."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Sdf, Usd

from primray.composition import Composition, variant_of
from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.settings import RenderSettings
from primray.usd import open_stage, translate

CAR = """#usda 1.0
(
    defaultPrim = "car"
    metersPerUnit = 1
)
def Xform "car" (
    prepend variantSets = "size"
    variants = {
        string size = "small"
    }
)
{
    variantSet "size" = {
        "small" {
            def Sphere "body"
            {
            }
        }
        "big" (
            prepend variantSets = "trim"
        ) {
            def Cube "body" (
                prepend references = @trim.usda@
            )
            {
            }
        }
    }
}
"""
TRIM = """#usda 1.0
(
    defaultPrim = "trim"
)
def "trim" (
    prepend variantSets = "trim"
)
{
    variantSet "trim" = {
        "plain" {
        }
        "gold" {
            color3f[] primvars:displayColor = [(1, 0.8, 0)]
        }
    }
}
"""
SHOT = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)
def "World"
{
    def "a" (
        prepend payload = @car.usda@
    )
    {
    }
    def "b" (
        prepend payload = @car.usda@
    )
    {
    }
    def "shared" (
        instanceable = true
        prepend references = @car.usda@
    )
    {
    }
    def Sphere "ball" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        rel material:binding = </Looks/red>
    }
    def Camera "eye"
    {
    }
}
def "Looks"
{
    def Material "red"
    {
        token outputs:surface.connect = </Looks/red/shader.outputs:surface>
        def Shader "shader"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (1, 0, 0)
            token outputs:surface
        }
    }
}
"""


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    for name, text in (("car", CAR), ("trim", TRIM), ("shot", SHOT)):
        (tmp_path / f"{name}.usda").write_text(text)
    return tmp_path / "shot.usda"


def shapes(stage: Usd.Stage, settings: RenderSettings | None = None) -> dict[str, str]:
    """Path and kind of what would be rendered."""
    description, _ = translate(stage, settings or RenderSettings())
    return {shape.path: type(shape).__name__ for shape in description.shapes}


def opened(path: Path, **composition: object) -> Usd.Stage:
    return open_stage(path, Diagnostics(), Composition(**composition))  # type: ignore[arg-type]


def test_a_variant_changes_the_stage_and_no_file(shot: Path) -> None:
    before = shot.read_bytes()
    assert shapes(opened(shot))["/World/a/body"] == "Sphere"
    stage = opened(shot, variants=("/World/a:size=big",))
    assert (shapes(stage)["/World/a/body"], shapes(stage)["/World/b/body"]) == ("Mesh", "Sphere")
    assert shot.read_bytes() == before
    assert not any(layer.dirty for layer in stage.GetLayerStack(includeSessionLayers=False))


def test_a_variant_may_be_in_what_an_earlier_one_brings(shot: Path) -> None:
    choices = ("/World/a:size=big", "/World/a/body:trim=gold")
    description, _ = translate(opened(shot, variants=choices), RenderSettings())
    assert any(surface.diffuse_color == pytest.approx((1, 0.8, 0)) for surface in description.surfaces)
    with pytest.raises(SettingsError, match="no variant set trim; its variant sets: none"):
        opened(shot, variants=choices[::-1])


def test_an_empty_name_takes_no_variant(shot: Path) -> None:
    assert "/World/a/body" not in shapes(opened(shot, variants=("/World/a:size=",)))


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ("/World/c:size=big", "below /World there are: /World/a, /World/b"),
        ("/World/a:color=big", "its variant sets: size"),
        ("/World/a:size=huge", "its variants: big, small"),
        ("/World/shared/body:size=big", "inside the instance /World/shared"),
    ],
)
def test_choices_that_are_not_there_list_those_that_are(choice: str, message: str, shot: Path) -> None:
    with pytest.raises(SettingsError, match=message) as error:
        opened(shot, variants=(choice,))
    assert error.value.code == "unknown-variant"


@pytest.mark.parametrize("text", ["size=big", "/a:size", "/a=b", "a:b=c", "", ":=", "/a:b=c=d"])
def test_malformed_choices_are_refused_before_anything_is_opened(text: str) -> None:
    with pytest.raises(SettingsError):
        RenderSettings(variants=(text,))
    assert variant_of("/a/b:c=d").set == "c"


def test_payloads_are_loaded_where_asked(shot: Path) -> None:
    assert {"/World/a/body", "/World/b/body"} <= set(shapes(opened(shot)))
    assert not {"/World/a/body", "/World/b/body"} & set(shapes(opened(shot, load=())))
    only = set(shapes(opened(shot, load=("/World/b",))))
    assert "/World/b/body" in only
    assert "/World/a/body" not in only


@pytest.mark.parametrize(("path", "listed"), [("/World/z", "/World/a"), ("/z", "/World"), ("/z/deep", "/World")])
@pytest.mark.parametrize("what", ["load", "mask"])
def test_loads_and_masks_of_what_is_not_there_list_what_is(what: str, path: str, listed: str, shot: Path) -> None:
    with pytest.raises(SettingsError, match=f"no such prim; below /[A-Za-z]* there are: .*{listed}") as error:
        opened(shot, **{what: (path,)})
    assert error.value.code == f"unknown-{what}"


def test_unloaded_payloads_are_told(shot: Path) -> None:
    diagnostics = Diagnostics()
    open_stage(shot, diagnostics, Composition(load=()))
    assert [d.prim_path for d in diagnostics if d.code == "payloads-unloaded"] == ["/World/a", "/World/b"]


def test_a_mask_keeps_what_its_prims_refer_to_and_the_camera(shot: Path) -> None:
    settings = RenderSettings(mask=("/World/ball",), camera="/World/eye")
    stage = open_stage(shot, Diagnostics(), settings.composition)
    description, _ = translate(stage, settings)
    assert [shape.path for shape in description.shapes] == ["/World/ball"]
    assert description.surfaces[0].path == "/Looks/red"
    assert description.camera.path == "/World/eye"
    with pytest.raises(SettingsError, match="no such prim"):
        opened(shot, mask=("/World/gone",))
    with pytest.raises(SettingsError):
        opened(shot, mask=("/World/a.attribute",))


def test_a_session_layer_is_stronger_and_variants_are_stronger_still(shot: Path) -> None:
    over = shot.with_name("over.usda")
    over.write_text(
        '#usda 1.0\nover "World"\n{\n over "ball"\n {\n  token visibility = "invisible"\n }\n over "a" (\n'
        '  variants = {\n   string size = "big"\n  }\n )\n {\n }\n}\n'
    )
    found = shapes(opened(shot, session_layer=str(over)))
    assert "/World/ball" not in found
    assert found["/World/a/body"] == "Mesh"
    found = shapes(opened(shot, session_layer=str(over), variants=("/World/a:size=small",)))
    assert found["/World/a/body"] == "Sphere"


def test_a_stage_in_memory_is_composed_anew_and_left_unchanged(shot: Path) -> None:
    stage = Usd.Stage.Open(str(shot), Usd.Stage.LoadNone)
    stage.Load("/World/a")
    stage.GetPrimAtPath("/World/ball").SetActive(False)  # an edit that is in no file
    session = stage.GetSessionLayer()
    with Usd.EditContext(stage, session):
        stage.DefinePrim("/World/extra", "Sphere")
    before = session.ExportToString()
    composed = open_stage(stage, Diagnostics(), Composition(variants=("/World/a:size=big",)))
    assert composed is not stage
    found = shapes(composed)
    assert found["/World/a/body"] == "Mesh"
    assert "/World/extra" in found
    assert not {"/World/ball", "/World/b/body"} & set(found)
    assert shapes(stage)["/World/a/body"] == "Sphere"
    assert session.ExportToString() == before


def test_layers_in_other_units_are_told(shot: Path) -> None:
    diagnostics = Diagnostics()
    open_stage(shot, diagnostics)
    (note,) = [d for d in diagnostics if d.code == "layer-units"]
    assert "metersPerUnit is 1" in note.message
    assert "car.usda" in note.message


def test_composition_errors_name_layer_and_prim(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    path.write_text('#usda 1.0\n(\n subLayers = [@gone1.usda@]\n)\ndef "p" (\n references = @gone2.usda@\n)\n{\n}\n')
    diagnostics = Diagnostics()
    open_stage(path, diagnostics)
    found = {d.prim_path: d.message for d in diagnostics if d.code == "composition-error"}
    assert "gone1.usda" in found["/"]
    assert "gone2.usda" in found["/p"]
    assert all("a.usda" in message for message in found.values())


def test_packages_open_by_their_first_layer_and_packages_in_packages(shot: Path) -> None:
    inner, outer = shot.with_name("inner.usdz"), shot.with_name("outer.usdz")
    with Sdf.ZipFileWriter.CreateNew(str(inner)) as writer:
        for name in ("shot.usda", "car.usda", "trim.usda"):
            writer.AddFile(str(shot.with_name(name)), name)
    root = shot.with_name("root.usda")
    root.write_text('#usda 1.0\ndef "in" (\n references = @inner.usdz@</World>\n)\n{\n}\n')
    with Sdf.ZipFileWriter.CreateNew(str(outer)) as writer:
        writer.AddFile(str(root), "root.usda")
        writer.AddFile(str(inner), "inner.usdz")
    for path, sphere in ((inner, "/World/a/body"), (outer, "/in/a/body")):
        diagnostics = Diagnostics()
        stage = open_stage(path, diagnostics)
        assert shapes(stage)[sphere] == "Sphere"
        assert not [d for d in diagnostics if d.code == "composition-error"]
