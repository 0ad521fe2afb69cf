"""Edits that would lessen a pixel's noise are tried: what each gains and what it does to the picture, and the stage stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdShade
from tests.images.sampling.test_rare_paths import room

import primray
from primray import usd
from primray.explanation.edits import RENDERS, _Trial, _tried


def trial(seed: int, *, noise: float, seconds: float, light: float = 1.0) -> _Trial:
    pixels = light + noise * np.random.default_rng(seed).standard_normal((RENDERS, 16, 16, 3))
    return _Trial(pixels, seconds, np.full(3, 1 / 3))


def test_time_is_variance_times_cost() -> None:
    tried = _tried("an edit", trial(0, noise=0.1, seconds=1.0), trial(1, noise=0.05, seconds=1.2), samples=64)
    assert tried.times == pytest.approx(0.3, rel=0.1)
    assert tried.times_range[0] < 0.3 < tried.times_range[1]
    assert tried.halves
    assert tried.gain_s == pytest.approx((2 * (1 - tried.times_range[1]), 2 * (1 - tried.times_range[0])))
    assert tried.change_range[0] < 0 < tried.change_range[1]


def test_a_picture_that_changes_is_told_from_noise() -> None:
    before = trial(0, noise=0.1, seconds=1.0)
    changed = [_tried("", before, trial(k, noise=0.1, seconds=1.0), 64).changes for k in range(1, 41)]
    assert sum(changed) <= 6  # 5 % of 40, and by chance
    assert _tried("", before, trial(1, noise=0.1, seconds=1.0, light=1.05), 64).changes
    shifted = trial(1, noise=0.1, seconds=1.0)
    shifted.pixels[:, 3, 4] += 0.6  # one pixel
    assert _tried("", before, shifted, 64).changes


def test_edits_of_a_caustic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.core.scene.CoreScene.caustics", lambda *_: None)
    (tmp_path / "room.usda").write_text(room(light="0.4"))
    stage = Usd.Stage.Open(str(tmp_path / "room.usda"))
    before = stage.GetSessionLayer().ExportToString()
    pixel = primray.explain(stage, 23, 21, resolution=(48, 32), spp=256, max_depth=6, renders=0, edits=True)
    found = {edit.edit: edit for edit in pixel.edits}
    assert found["--caustics off"].halves
    assert found["--caustics off"].changes
    assert found["--caustics off"].change_range[1] < 0
    larger = found["/key 2 times as large, of the same power"]
    assert larger.times < found["--caustics off"].times * 1e3
    assert "/m with a roughness of 0.3" in found
    assert [edit.times for edit in pixel.edits] == sorted(edit.times for edit in pixel.edits)
    assert stage.GetSessionLayer().ExportToString() == before
    assert stage.GetAttributeAtPath("/key.inputs:radius").Get() == pytest.approx(0.4)
    assert stage.GetAttributeAtPath("/m/s.inputs:roughness").Get() == 0


def test_a_rougher_mirror_changes_what_its_caustic_lights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.core.scene.CoreScene.caustics", lambda *_: None)
    (tmp_path / "room.usda").write_text(room(light="0.4", ball="mirror"))
    pixel = primray.explain(tmp_path / "room.usda", 23, 21, resolution=(48, 32), spp=256, max_depth=6, renders=0, edits=True)
    (rougher,) = [edit for edit in pixel.edits if edit.edit == "/m with a roughness of 0.3"]
    assert rougher.changes


@pytest.mark.parametrize(
    ("kind", "sizes", "normalize", "intensity"),
    [
        ("SphereLight", {"radius": 0.5}, False, 2.5),
        ("RectLight", {"width": 2.0, "height": 3.0}, False, 2.5),
        ("DiskLight", {"radius": 0.5}, True, 10.0),
        ("DistantLight", {"angle": 1.0}, False, 2.5),
    ],
)
def test_a_larger_light_keeps_its_power(kind: str, sizes: dict[str, float], normalize: bool, intensity: float) -> None:
    stage = Usd.Stage.CreateInMemory()
    light = stage.DefinePrim("/key", kind)
    for name, value in {**sizes, "intensity": 10.0}.items():
        light.GetAttribute(f"inputs:{name}").Set(value)
    light.GetAttribute("inputs:normalize").Set(normalize)
    assert usd.can_be_larger(stage, "/key")
    with usd.larger_light(stage, "/key", 2):
        assert light.GetAttribute("inputs:intensity").Get() == pytest.approx(intensity)
        assert all(light.GetAttribute(f"inputs:{name}").Get() == 2 * value for name, value in sizes.items())
    assert light.GetAttribute("inputs:intensity").Get() == 10
    assert stage.GetSessionLayer().empty


def test_what_has_no_size_cannot_be_larger() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/dome", "DomeLight")
    stage.DefinePrim("/sun", "DistantLight").GetAttribute("inputs:angle").Set(0.0)
    assert not any(usd.can_be_larger(stage, path) for path in ("/dome", "/sun", "/nothing", "the air", ""))


def shader(stage: Usd.Stage, kind: str, **inputs: float) -> UsdShade.Shader:
    material = UsdShade.Material.Define(stage, "/m")
    found = UsdShade.Shader.Define(stage, "/m/graph/shader")
    found.CreateIdAttr(kind)
    material.CreateSurfaceOutput().ConnectToSource(found.ConnectableAPI(), "surface")
    for name, value in inputs.items():
        found.CreateInput(name, Sdf.ValueTypeNames.Float).Set(value)
    return found


@pytest.mark.parametrize(
    ("kind", "inputs"),
    [
        ("UsdPreviewSurface", {"roughness": 0.1, "clearcoatRoughness": 0.01}),
        ("ND_open_pbr_surface_surfaceshader", {"specular_roughness": 0.0, "coat_roughness": 0.1}),
        ("ND_gltf_pbr_surfaceshader", {"roughness": 0.2}),
    ],
)
def test_a_rougher_material_is_as_before_afterwards(kind: str, inputs: dict[str, float]) -> None:
    stage = Usd.Stage.CreateInMemory()
    own = shader(stage, kind, **inputs)
    assert usd.can_be_rougher(stage, "/m", 0.3)
    with usd.rougher_material(stage, "/m", 0.3):
        assert all(own.GetInput(name).Get() == pytest.approx(0.3) for name in inputs)
    assert all(own.GetInput(name).Get() == pytest.approx(value) for name, value in inputs.items())
    assert stage.GetSessionLayer().empty


def test_a_rougher_material_sets_the_input_that_its_shader_is_connected_to() -> None:
    stage = Usd.Stage.CreateInMemory()
    own = shader(stage, "UsdPreviewSurface", roughness=0.9)
    outer = UsdShade.Material(stage.GetPrimAtPath("/m")).CreateInput("gloss", Sdf.ValueTypeNames.Float)
    outer.Set(0.05)
    own.GetInput("roughness").ConnectToSource(outer)
    with usd.rougher_material(stage, "/m", 0.3):
        assert outer.Get() == pytest.approx(0.3)
        assert own.GetInput("roughness").GetAttr().Get() == pytest.approx(0.9)


def test_what_has_no_smooth_lobe_cannot_be_rougher() -> None:
    stage = Usd.Stage.CreateInMemory()
    own = shader(stage, "UsdPreviewSurface", roughness=0.4)
    assert not any(usd.can_be_rougher(stage, path, 0.3) for path in ("/m", "/m/graph/shader", "/nothing", "the air", ""))
    texture = UsdShade.Shader.Define(stage, "/m/texture")
    texture.CreateIdAttr("UsdUVTexture")
    own.GetInput("roughness").Set(0.1)
    assert usd.can_be_rougher(stage, "/m", 0.3)
    own.GetInput("roughness").ConnectToSource(texture.ConnectableAPI(), "r")
    assert not usd.can_be_rougher(stage, "/m", 0.3)
    assert not usd.can_be_rougher(rough_diffuse(), "/m", 0.3)


def rough_diffuse() -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    shader(stage, "ND_oren_nayar_diffuse_bsdf", roughness=0.0)
    return stage
