"""A stage that is rendered again and again: its choices, its files, and what becomes of both where they are wrong."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from tests import vdb_writer as vdb
from tests.unit.usd.volumes.volume_text import grid, write

import primray
from primray import usd
from primray.errors import PrimrayError, SettingsError, StageOpenError
from primray.images.image import Image
from primray.live.viewed_scene import Size, View, ViewedScene
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
