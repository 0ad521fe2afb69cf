"""A stage that is rendered again and again: its choices, its files, and what becomes of both where they are wrong."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdLux, UsdShade
from tests import vdb_writer as vdb
from tests.unit.usd.volumes.volume_text import grid, write

import primray
from primray import usd
from primray.errors import PrimrayError, SettingsError, StageOpenError
from primray.images.image import Image
from primray.live.aov_pictures import SHOWN
from primray.live.viewed_scene import SKETCH_RATE, Size, View, ViewedScene
from primray.render import Steps
from primray.usd.incremental import translation

STAGE = """#usda 1.0
(
    subLayers = [@./more.usda@]
)
def Xform "w" (
    prepend variantSets = "v"
    variants = {
        string v = "a"
    }
)
{
    variantSet "v" = {
        "a" {
            def Sphere "s" {
            }
        }
        "b" {
            def Cube "c" {
            }
        }
    }
}
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 12)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
MORE = """#usda 1.0
over "w" {
    def Cone "cone" {
        double3 xformOp:translate = (%s, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


@pytest.fixture
def scene(tmp_path: Path) -> ViewedScene:
    (tmp_path / "s.usda").write_text(STAGE)
    (tmp_path / "more.usda").write_text(MORE % 3)
    return ViewedScene(str(tmp_path / "s.usda"), primray.RenderSettings(resolution=(48, 32), seed=3))


def picture(scene: ViewedScene, spp: int = 2) -> Image:
    seen: list[View] = []
    assert scene.render(Size(1.0, spp), seen.append, lambda: False, lambda: True)
    assert [view.finished for view in seen] == [True]
    return seen[0].image


def same(a: Image, b: Image) -> bool:
    return bool((a.pixels == b.pixels).all())


def test_pictures_are_those_of_render(scene: ViewedScene) -> None:
    settings = primray.RenderSettings(resolution=(48, 32), spp=2, seed=3)
    assert same(picture(scene), primray.render(scene.path, settings))
    scene.choose("/w", "v", "b")
    assert same(picture(scene), primray.render(scene.path, settings, variants=["/w:v=b"]))
    assert [row["selection"] for row in scene.variant_sets] == ["b"]


def test_a_camera_that_is_put_where_it_stands_sees_the_same(scene: ViewedScene) -> None:
    first = picture(scene)
    scene.move(lambda orbit, camera: orbit.tumbled(0.0, 0.0))
    put = picture(scene)
    assert np.mean(np.abs(put.pixels - first.pixels)) < 1e-3 * np.mean(first.pixels)  # measured from another point
    scene.move(lambda orbit, camera: orbit.tumbled(0.0, 0.0))
    assert same(picture(scene), put)
    scene.move(lambda orbit, camera: orbit.tumbled(0.2, 0.0))
    assert not same(picture(scene), put)
    scene.reset()
    assert same(picture(scene), first)


def test_a_camera_that_goes_around_the_scene_leaves_its_points(scene: ViewedScene, monkeypatch: pytest.MonkeyPatch) -> None:
    picture(scene)
    scene.move(lambda orbit, camera: orbit.tumbled(0.01, 0.0))
    picture(scene)
    monkeypatch.setattr(Steps, "build", None)
    for _ in range(20):
        scene.move(lambda orbit, camera: orbit.tumbled(0.1, 0.02))
        picture(scene)


def test_only_what_a_move_touches_is_translated_again(scene: ViewedScene, monkeypatch: pytest.MonkeyPatch) -> None:
    picture(scene)
    for _ in range(2):  # the first one makes the camera that moves
        scene.move(lambda orbit, camera: orbit.tumbled(0.01, 0.0))
        moved = picture(scene)
    monkeypatch.setattr(translation, "_translated_recorded", None)
    scene.move(lambda orbit, camera: orbit.tumbled(0.01, 0.0))
    again = picture(scene)
    monkeypatch.undo()
    assert not same(again, moved)
    scene.open()
    assert same(picture(scene), again)


def test_files_that_changed(scene: ViewedScene, tmp_path: Path) -> None:
    first = picture(scene)
    assert scene.files() == {str(tmp_path / "s.usda"), str(tmp_path / "more.usda")}
    (tmp_path / "more.usda").write_text(MORE % -3)
    scene.read_anew({str(tmp_path / "more.usda")})
    second = picture(scene)
    assert not same(first, second)
    (tmp_path / "more.usda").write_text("#usda 1.0\n}}\n")
    with pytest.raises(StageOpenError, match=r"USD cannot read it: more\.usda:2") as caught:
        scene.read_anew({str(tmp_path / "more.usda")})
    assert caught.value.where == "more.usda"
    assert same(picture(scene), second)  # as it was read last


def test_a_texture_is_watched_and_so_is_what_is_missing(scene: ViewedScene, tmp_path: Path) -> None:
    (tmp_path / "more.usda").write_text('#usda 1.0\ndef DomeLight "d" {\n    asset inputs:texture:file = @./sky.exr@\n}\n')
    assert str(tmp_path / "sky.exr") in scene.files()
    Image(np.ones((4, 8, 3), np.float32), channels=("R", "G", "B")).save(tmp_path / "sky.exr")
    assert str(tmp_path / "sky.exr") in scene.files()
    (tmp_path / "more.usda").write_text("#usda 1.0\n}}\n")
    assert scene.files() >= {str(tmp_path / "s.usda")}


def test_choices_that_there_are_not(scene: ViewedScene) -> None:
    first = picture(scene)
    for prim, of_set, name in (("/w", "v", "c"), ("/w", "u", "a"), ("/x", "v", "a")):
        with pytest.raises(PrimrayError):
            scene.choose(prim, of_set, name)
    scene.look_through("/nobody")
    with pytest.raises(SettingsError, match="There is no camera /nobody"):
        picture(scene)
    scene.look_through(None)
    assert same(picture(scene), first)


def test_a_camera_that_goes_away_while_it_is_looked_through(scene: ViewedScene, tmp_path: Path) -> None:
    picture(scene)
    scene.move(lambda orbit, camera: orbit.tumbled(0.2, 0.0))
    (tmp_path / "s.usda").write_text(STAGE.replace('"cam"', '"other"'))
    scene.read_anew({str(tmp_path / "s.usda")})
    picture(scene)
    assert (scene.authored_path, scene.orbit) == ("/other", None)


def test_it_ends_when_it_is_told(scene: ViewedScene) -> None:
    seen: list[View] = []
    assert not scene.render(Size(1.0, 4096), seen.append, lambda: True, lambda: len(seen) < 2)
    assert len(seen) == 2
    assert not any(view.finished for view in seen)


def test_a_texture_that_changed(scene: ViewedScene, tmp_path: Path) -> None:
    (tmp_path / "more.usda").write_text('#usda 1.0\ndef DomeLight "d" {\n    asset inputs:texture:file = @./sky.exr@\n}\n')
    sky = np.ones((4, 8, 3), np.float32)
    for level in (1.0, 3.0):
        Image(level * sky, channels=("R", "G", "B")).save(tmp_path / "sky.exr")
        scene.read_anew({str(tmp_path / "sky.exr"), str(tmp_path / "more.usda")})
        assert np.allclose(picture(scene).pixels[0, 0, :3], level, rtol=0.05)


SMOKE = """#usda 1.0
def Volume "smoke" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel field:density = </smoke/density>
    rel material:binding = </look>
    def OpenVDBAsset "density" {
        asset filePath = @./smoke.vdb@
        token fieldName = "density"
    }
}
def Material "look" {
    token outputs:arnold:volume.connect = </look/v.outputs:out>
    def Shader "v" {
        uniform token info:id = "arnold:standard_volume"
        float inputs:density = %s
        float inputs:scatter = 0
        token outputs:out
    }
}
def DomeLight "sky" {
}
"""


def test_a_volume_that_is_edited(scene: ViewedScene, tmp_path: Path) -> None:
    """An edit of its density and one of its file are seen, as in a render of the stage."""
    settings = primray.RenderSettings(resolution=(48, 32), spp=2, seed=3)
    write(tmp_path, grid(0.5))
    (tmp_path / "more.usda").write_text(SMOKE % 0.1)
    scene.read_anew({str(tmp_path / "more.usda")})
    thin = picture(scene)
    assert str(tmp_path / "smoke.vdb") in scene.files()
    (tmp_path / "more.usda").write_text(SMOKE % 2)
    scene.read_anew({str(tmp_path / "more.usda")})
    thick = picture(scene)
    assert thick.pixels[..., :3].mean() < thin.pixels[..., :3].mean()
    assert same(thick, primray.render(scene.path, settings))
    write(tmp_path, grid(np.full(512, 0.125), metadata={"note": vdb.string("changed")}))
    scene.read_anew({str(tmp_path / "smoke.vdb")})
    thinned = picture(scene)
    assert thinned.pixels[..., :3].mean() > thick.pixels[..., :3].mean()
    assert same(thinned, primray.render(scene.path, settings))


def test_a_package_that_changed(tmp_path: Path) -> None:
    for number, shape in enumerate(("Sphere", "Cube")):
        (tmp_path / "in.usda").write_text(f'#usda 1.0\ndef {shape} "s" {{}}\n')
        usd.write_usdz(str(tmp_path / "in.usda"), str(tmp_path / "new.usdz"))
        os.replace(tmp_path / "new.usdz", tmp_path / "a.usdz")
        settings = primray.RenderSettings(resolution=(48, 32), spp=2)
        if number == 0:
            scene = ViewedScene(str(tmp_path / "a.usdz"), settings)
            first = picture(scene)
        else:
            assert scene.files() == {str(tmp_path / "a.usdz")}
            scene.read_anew({str(tmp_path / "a.usdz")})
            (tmp_path / "a.usdz").rename(tmp_path / "b.usdz")  # another name: nothing of it is kept
            expected = primray.render(str(tmp_path / "b.usdz"), settings)
            (tmp_path / "b.usdz").rename(tmp_path / "a.usdz")
            assert same(picture(scene), expected)
            assert not same(first, expected)


HEAVY = """#usda 1.0
def Mesh "cage" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 2, 3, 5, 4, 4, 5, 7, 6, 6, 7, 1, 0, 1, 7, 5, 3, 6, 0, 2, 4]
    point3f[] points = [(-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1), (-1, 1, -1), (1, 1, -1), (-1, -1, -1), (1, -1, -1)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1), (1, 1), (0, 2), (1, 2), (0, 3), (1, 3)] (
        interpolation = "vertex"
    )
    rel material:binding = </look>
}
def Material "look"
{
    token outputs:surface.connect = </look/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </look/t.outputs:rgb>
        token outputs:surface
    }
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./red.png@
        float2 inputs:st.connect = </look/r.outputs:result>
        float3 outputs:rgb
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
def DomeLight "sky" {
}
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 12)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


@pytest.fixture
def heavy(tmp_path: Path) -> ViewedScene:
    (tmp_path / "heavy.usda").write_text(HEAVY)
    red = np.full((4, 4, 4), (0.9, 0.0, 0.0, 1.0), np.float32)
    Image(red).save(tmp_path / "red.png")
    return ViewedScene(str(tmp_path / "heavy.usda"), primray.RenderSettings(resolution=(96, 64), seed=3))


def shown(scene: ViewedScene, size: Size) -> Image:
    seen: list[View] = []
    assert scene.render(size, seen.append, lambda: False, lambda: True)
    return seen[-1].image


def test_a_draft_of_a_heavy_stage_is_a_sketch_until_the_scene_is_there(heavy: ViewedScene) -> None:
    """All of them are renders that anybody can make, to the bit."""
    draft, settings = (
        Size(3.0, 2, is_draft=True, keeps_surfaces=True),
        primray.RenderSettings(resolution=(96, 64), seed=3, spp=2),
    )
    sketch = shown(heavy, draft)
    plain: dict[str, Any] = {"surface_textures": False, "dicing_rate": SKETCH_RATE}
    assert sketch.resolution == (32, 21)
    assert same(sketch, primray.render(heavy.path, settings, pixel_size=3.0, **plain))
    red, green = sketch.pixels[10, 16, :2]
    assert red == pytest.approx(green, rel=1e-3)  # grey
    assert heavy.is_sketch
    ended = threading.Event()
    heavy.prepare_ahead(ended.set)
    heavy.move(lambda orbit, camera: orbit.tumbled(0.1, 0.0))  # while it is prepared
    turned = shown(heavy, draft)
    assert not same(turned, sketch)
    assert ended.wait(60)
    assert not heavy.is_sketch
    found = shown(heavy, Size(3.0, 2, is_draft=True))
    assert found.pixels[10, 16, 0] > 2 * found.pixels[10, 16, 1]
    (Path(heavy.path).parent / "camera.usda").write_text(heavy.camera_text())
    laid: dict[str, Any] = {"session_layer": str(Path(heavy.path).parent / "camera.usda"), "camera": "/primray_view"}
    assert same(found, primray.render(heavy.path, settings, pixel_size=3.0, **laid))
    assert same(picture(heavy), primray.render(heavy.path, settings, **laid))


def test_surfaces_stay_while_the_camera_moves_and_are_diced_where_it_rests(
    heavy: ViewedScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    draft, look = Size(2.0, 2, is_draft=True, keeps_surfaces=True), Size(1.0, 2, keeps_surfaces=True)
    picture(heavy)
    assert heavy.through is not None
    settings = primray.RenderSettings(resolution=(96, 64), seed=3, spp=2, dicing_camera=heavy.through)
    with monkeypatch.context() as patch:
        patch.setattr(Steps, "dice", None)
        patch.setattr(Steps, "build", None)
        for _ in range(10):
            heavy.move(lambda orbit, camera: orbit.tumbled(0.15, 0.02).dollied(0.05, camera))
            moved, whole = shown(heavy, draft), shown(heavy, look)
    assert not heavy.is_exact
    layer = Path(heavy.path).parent / "camera.usda"
    layer.write_text(heavy.camera_text())
    laid: dict[str, Any] = {"session_layer": str(layer), "camera": "/primray_view"}
    assert same(moved, primray.render(heavy.path, settings, pixel_size=2.0, **laid))
    assert same(whole, primray.render(heavy.path, settings, **laid))
    ended = threading.Event()
    heavy.prepare_ahead(ended.set)
    assert ended.wait(60)
    assert heavy.is_exact
    with monkeypatch.context() as patch:
        patch.setattr(Steps, "dice", None)
        exact = picture(heavy)
    assert same(exact, primray.render(heavy.path, settings, dicing_camera=None, **laid))


def test_drafts_and_pictures_share_the_scene(heavy: ViewedScene, monkeypatch: pytest.MonkeyPatch) -> None:
    picture(heavy)
    monkeypatch.setattr(Steps, "build", None)
    monkeypatch.setattr(Steps, "dice", None)
    for size in (Size(2.7, 2, is_draft=True), Size(1.0, 2), Size(5.0, 2, is_draft=True)):
        shown(heavy, size)


def test_a_simple_stage_needs_no_sketch(scene: ViewedScene) -> None:
    shown(scene, Size(4.0, 2, is_draft=True))
    assert not scene.is_sketch
    assert scene.is_exact


def test_another_choice_ends_what_is_prepared(heavy: ViewedScene, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[bool] = []
    shown(heavy, Size(3.0, 2, is_draft=True))
    begun, going_on = threading.Event(), threading.Event()

    def tell(step: str, done: int, of: int) -> None:
        begun.set()
        assert going_on.wait(60)

    heavy.on_progress = tell
    heavy.prepare_ahead(lambda: ended.append(True))
    assert begun.wait(60)
    heavy.on_progress = None
    threading.Timer(0.1, going_on.set).start()
    heavy.open()
    assert not ended
    picture(heavy)
    assert heavy.is_exact


def test_what_is_at_a_point_of_the_picture(scene: ViewedScene) -> None:
    assert scene.pick(0.5, 0.5) is None  # nothing has been rendered
    picture(scene)
    hit = scene.pick(0.5, 0.5)
    assert hit is not None
    assert hit.prim == "/w/s"
    assert hit.distance == pytest.approx(11, abs=0.01)
    assert hit.position == pytest.approx([0, 0, 1], abs=0.3)
    assert scene.pick(0.01, 0.01) is None
    scene.select(0.5, 0.5)
    assert scene.selected is not None
    scene.choose("/w", "v", "b")
    assert scene.selected is None  # it may not be there any more
    picture(scene)
    found = scene.pick(0.5, 0.5)
    assert found is not None
    assert found.prim == "/w/c"


def test_what_is_selected_is_framed(scene: ViewedScene) -> None:
    picture(scene)
    scene.frame()
    everything = scene.orbit
    scene.select(0.5, 0.5)
    scene.frame()
    assert everything is not None
    assert scene.orbit is not None
    assert scene.orbit.target == pytest.approx([0, 0, 0], abs=1e-6)
    assert scene.orbit.distance < 0.8 * everything.distance


def test_it_turns_about_what_is_under_the_mouse(scene: ViewedScene) -> None:
    picture(scene)
    scene.turn_about(0.5, 0.5)
    assert scene.orbit is not None
    assert scene.orbit.target == pytest.approx([0, 0, 1], abs=0.3)
    assert scene.orbit.eye == pytest.approx([0, 0, 12])
    scene.turn_about(0.01, 0.01)  # nothing: what is framed
    assert scene.bounds is not None
    assert scene.orbit.target[2] == pytest.approx(float(np.mean([side[2] for side in scene.bounds])), abs=1e-6)
    assert scene.orbit.eye == pytest.approx([0, 0, 12])


@pytest.mark.parametrize("name", SHOWN)
def test_aovs_are_shown(scene: ViewedScene, name: str) -> None:
    seen: list[View] = []
    scene.aov = name
    scene.render(Size(1.0, 4), seen.append, lambda: False, lambda: True)
    assert len(seen) == 1
    drawn = seen[0].drawn
    assert (drawn is None) == (name in ("albedo", "emission"))
    values = seen[0].image.pixels if drawn is None else drawn
    if name not in ("emission", "instance", "material"):  # a stage without lights, instances and materials
        assert (values[16, 24, :3] != values[0, 0, :3]).any()


def test_the_camera_of_another_stage_needs_a_picture(scene: ViewedScene) -> None:
    scene.open()
    with pytest.raises(SettingsError):
        scene.camera_text()


def test_a_callers_stage_is_edited_and_its_session_layer_left_alone(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateInMemory()
    light = UsdLux.DomeLight.Define(stage, "/light")
    UsdGeom.Cube.Define(stage, "/c")
    scene = ViewedScene(stage, primray.RenderSettings(resolution=(24, 16), seed=3))
    first = picture(scene)
    assert scene.stage is stage
    assert not scene.is_edited()
    scene.move(lambda orbit, camera: orbit.tumbled(0.2, 0.0))
    moved = picture(scene)
    assert not same(moved, first)
    assert not scene.is_edited()  # the camera of the view is no edit
    assert not stage.GetPrimAtPath("/primray_view")
    assert stage.GetSessionLayer().empty
    light.CreateIntensityAttr().Set(4.0)
    assert scene.is_edited()
    assert picture(scene).pixels.mean() > 2 * moved.pixels.mean()
    stage.GetSessionLayer().ImportFromString('#usda 1.0\nover "light" {\n    float inputs:intensity = 0.5\n}\n')
    assert scene.is_edited()
    assert picture(scene).pixels.mean() < moved.pixels.mean()
    assert scene.files() == set()


def test_what_a_stage_offers_is_looked_at_after_edits(scene: ViewedScene) -> None:
    picture(scene)
    assert scene.cameras == ["/cam"]
    UsdGeom.Camera.Define(scene.stage, "/other")
    scene.stage.GetPrimAtPath("/w").GetAttribute("xformOp:translate")
    UsdGeom.Sphere.Get(scene.stage, "/w/s").GetRadiusAttr().Set(2.0, 7)
    UsdGeom.Sphere.Get(scene.stage, "/w/s").GetRadiusAttr().Set(1.0, 1)
    scene.note_edits()
    assert sorted(scene.cameras) == ["/cam", "/other"]
    assert scene.times == (1.0, 7.0)
    scene.look_through("/other")
    scene.stage.RemovePrim("/other")
    with pytest.raises(PrimrayError, match="/other"):
        picture(scene)


def test_what_is_freed_is_made_again(scene: ViewedScene) -> None:
    scene.move(lambda orbit, camera: orbit.tumbled(0.0, 0.0))
    first = picture(scene)
    scene.move(lambda orbit, camera: orbit.tumbled(0.3, 0.1))
    moved, stage = picture(scene), scene.stage
    scene.free()
    assert scene.pick(0.5, 0.5) is None
    assert scene.stage is stage
    assert same(picture(scene), moved)
    assert not same(first, moved)


def test_what_is_picked_has_its_material(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateInMemory()
    sphere = UsdGeom.Sphere.Define(stage, "/s").GetPrim()
    material, shader = UsdShade.Material.Define(stage, "/looks/red"), UsdShade.Shader.Define(stage, "/looks/red/s")
    shader.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(sphere).Bind(material)
    scene = ViewedScene(stage, primray.RenderSettings(resolution=(24, 16)))
    picture(scene)
    hit = scene.pick(0.5, 0.5)
    assert hit is not None
    assert (hit.prim, hit.material) == ("/s", "/looks/red")
    UsdShade.MaterialBindingAPI(sphere).UnbindAllBindings()
    picture(scene)
    hit = scene.pick(0.5, 0.5)
    assert hit is not None
    assert hit.material == ""
