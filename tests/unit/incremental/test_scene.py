"""What edits leave as it is, what makes a scene look again, and what a scene refuses."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade

import primray
from primray.incremental import core_update
from primray.render import Steps
from primray.textures import texture, texture_set
from primray.usd.incremental import translation

from ...properties.random_edits import stage_of
from ...properties.test_kept_scenes import write_chequers

pytestmark = pytest.mark.filterwarnings("ignore::primray.RenderWarning")
SETTINGS = primray.RenderSettings(resolution=(16, 9), spp=2, threads=1, camera="/eyes/cam")


@pytest.fixture
def stage() -> Usd.Stage:
    import random

    return stage_of(random.Random(4))


def bits(image: primray.Image) -> str:
    return str(image.report["pixels_sha256"])


def lit(stage: Usd.Stage) -> None:
    UsdLux.LightAPI(stage.GetPrimAtPath("/world/g1/SphereLight")).GetIntensityAttr().Set(77.0)


def rough(stage: Usd.Stage) -> None:
    UsdShade.Shader(stage.GetPrimAtPath("/mats/m1/surface")).GetInput("roughness").Set(0.9)


def turned(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/eyes/cam").GetAttribute("focalLength").Set(50.0)


def nudged(stage: Usd.Stage) -> None:
    place = stage.GetPrimAtPath("/eyes/cam").GetAttribute("xformOp:translate")
    place.Set(place.Get() + Gf.Vec3d(0.001, 0.001, -0.001))


def moved(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/world/g0/m2").GetAttribute("xformOp:translate").Set(Gf.Vec3d(0.1, 0.2, 0.3))


@pytest.mark.parametrize("edit", [lit, rough, turned, nudged, moved])
def test_a_value_is_translated_and_built_by_itself(edit, stage: Usd.Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = primray.Scene(stage)
    scene.render(SETTINGS)
    kept = []
    build_again = core_update.updated_core_scene

    def noted(*given: Any) -> Any:
        kept.append(build_again(*given))
        return kept[-1]

    monkeypatch.setattr(translation, "_translated_recorded", None)
    monkeypatch.setattr(core_update, "updated_core_scene", noted)
    edit(stage)
    image = scene.render(SETTINGS)
    assert kept
    assert kept[0] is not None
    monkeypatch.undo()
    assert bits(image) == bits(primray.render(stage, SETTINGS))


def test_without_an_edit_nothing_is_built(stage: Usd.Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = primray.Scene(stage)
    scene.render(SETTINGS)
    monkeypatch.setattr(translation, "_translated_recorded", None)
    monkeypatch.setattr(core_update, "updated_core_scene", None)
    monkeypatch.setattr(Steps, "build", None)
    image = scene.render(SETTINGS, spp=8, seed=3)
    monkeypatch.undo()
    assert bits(image) == bits(primray.render(stage, SETTINGS, spp=8, seed=3))


def test_a_texture_that_is_written_again_is_read_again(tmp_path: Path) -> None:
    import random

    image = tmp_path / "chequers.png"
    write_chequers(image)
    stage = stage_of(random.Random(4), str(image))
    scene = primray.Scene(stage)
    before = scene.render(SETTINGS)
    write_chequers(image, 90)
    os.utime(image, ns=(1, 1))
    after = scene.render(SETTINGS)
    assert bits(after) == bits(primray.render(stage, SETTINGS))
    assert bits(after) != bits(before)


def test_a_render_that_is_stopped_leaves_the_scene_as_it_is(stage: Usd.Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = primray.Scene(stage)
    with pytest.raises(primray.errors.RenderCancelled):
        scene.render(SETTINGS, spp=4096, resolution=(320, 180), progress=lambda *so_far: False)
    monkeypatch.setattr(Steps, "build", None)
    scene.render(SETTINGS, resolution=(320, 180))


def test_a_render_that_fails_is_forgotten(stage: Usd.Stage) -> None:
    scene = primray.Scene(stage)
    with pytest.raises(primray.errors.SettingsError):
        scene.render(SETTINGS, camera="/nobody")
    assert bits(scene.render(SETTINGS)) == bits(primray.render(stage, SETTINGS))


def test_layers_that_are_loaded_again_are_rendered_again(tmp_path: Path) -> None:
    path = tmp_path / "lit.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.Cube.Define(stage, "/cube")
    UsdLux.DomeLight.Define(stage, "/sky").CreateIntensityAttr(1.0)
    stage.Save()
    scene = primray.Scene(path)
    before = scene.render(SETTINGS, camera=None)
    path.write_text(path.read_text().replace("intensity = 1", "intensity = 3"))
    scene.stage.GetRootLayer().Reload(True)
    after = scene.render(SETTINGS, camera=None)
    assert np.nanmax(after.pixels) > 2 * np.nanmax(before.pixels)


def test_composition_is_the_scenes(stage: Usd.Stage) -> None:
    with pytest.raises(primray.errors.SettingsError, match="its composition"):
        primray.Scene(stage).render(SETTINGS, mask=("/world",))
    with pytest.raises(primray.errors.SettingsError, match="not with spp"):
        primray.Scene(stage, spp=4)
    assert primray.Scene(stage, mask=("/eyes", "/world/g1")).render(SETTINGS).report["scene"]["meshes"] == 3


@pytest.fixture
def textured(tmp_path: Path) -> Usd.Stage:
    import random

    write_chequers(tmp_path / "chequers.png")
    return stage_of(random.Random(4), str(tmp_path / "chequers.png"))


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the image files that are read."""
    names: list[str] = []
    load = texture.load_texture

    def noted(file: Any, *given: Any, **named: Any) -> Any:
        names.append(Path(named["path"]).name)
        return load(file, *given, **named)

    monkeypatch.setattr(texture_set, "load_texture", noted)
    return names


def grown(stage: Usd.Stage) -> None:
    points = stage.GetPrimAtPath("/world/g0/m2").GetAttribute("points")
    points.Set([1.5 * p for p in points.Get()])


def gone_afar(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/eyes/cam").GetAttribute("xformOp:translate").Set(Gf.Vec3d(40, 0, 90))


@pytest.mark.parametrize("edit", [grown, gone_afar])
def test_images_stay_in_the_core_where_all_else_is_built_again(edit, textured: Usd.Stage, read: list[str]) -> None:
    scene = primray.Scene(textured)
    scene.render(SETTINGS)
    assert read
    read.clear()
    edit(textured)
    image = scene.render(SETTINGS)
    assert not read
    assert bits(image) == bits(primray.render(textured, SETTINGS))
    read.clear()
    assert bits(scene.render(SETTINGS, seed=2)) == bits(primray.render(textured, SETTINGS, seed=2))


@pytest.mark.parametrize("edit", [lambda stage: None, grown], ids=["alone", "beside another edit"])
def test_images_are_read_again_for_levels_that_were_left_out(edit, textured: Usd.Stage, read: list[str]) -> None:
    gone_afar(textured)
    scene = primray.Scene(textured)
    afar = scene.render(SETTINGS)
    before = len(read)
    edit(textured)
    textured.GetPrimAtPath("/eyes/cam").GetAttribute("xformOp:translate").Set(Gf.Vec3d(0, 0.5, 3))
    near = scene.render(SETTINGS, resolution=(160, 90))
    assert len(read) > before
    new = primray.render(textured, SETTINGS, resolution=(160, 90))
    assert bits(near) == bits(new) != bits(afar)
    assert near.report["features"] == new.report["features"]  # with the size of what rays may ask for


def test_of_several_images_only_the_new_one_is_read(textured: Usd.Stage, read: list[str], tmp_path: Path) -> None:
    scene = primray.Scene(textured)
    before = scene.render(SETTINGS)
    read.clear()
    write_chequers(tmp_path / "other.png", 90)
    textured.GetPrimAtPath("/mats/m1/texture").GetAttribute("inputs:file").Set(str(tmp_path / "other.png"))
    after = scene.render(SETTINGS)
    assert set(read) == {"other.png"}
    assert bits(after) == bits(primray.render(textured, SETTINGS)) != bits(before)


def test_an_image_that_is_read_otherwise_is_given_to_the_core_again(tmp_path: Path) -> None:
    """A light clamps what is negative, for surfaces that read the same file too."""
    import random

    import OpenImageIO as oiio

    path = tmp_path / "below.exr"
    texels = np.where(np.indices((8, 8)).sum(axis=0) % 2, 1.0, -1.0).astype(np.float32)
    assert oiio.ImageBuf(np.repeat(texels[..., None], 3, axis=2)).write(str(path))
    stage = stage_of(random.Random(4), str(path))
    scene = primray.Scene(stage)
    before = scene.render(SETTINGS)
    UsdLux.DomeLight.Define(stage, "/sky").CreateTextureFileAttr(str(path))
    after = scene.render(SETTINGS)
    assert bits(after) == bits(primray.render(stage, SETTINGS)) != bits(before)
