"""Moves of the camera around something: what is prepared for other views stays, and the bits are those of new renders."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade
from tests.properties.random_edits import COSTLY, stage_of
from tests.properties.test_kept_scenes import write_chequers
from tests.unit.usd.volumes.volume_text import grid, volume_text, write

import primray
from primray import core
from primray.core import light_upload
from primray.settings import RenderSettings

pytestmark = pytest.mark.filterwarnings("ignore::primray.RenderWarning")
SETTINGS = RenderSettings(resolution=(32, 24), spp=2, threads=1, camera="/eyes/cam", dicing_rate=0.25)


class Calls:
    """Numbers of scenes that are built, and of lights that are handed over."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.built, self.lights = 0, 0
        build, add = core.build, light_upload.LightUpload.add

        def counting_build(*args: Any, **options: Any) -> Any:
            self.built += 1
            return build(*args, **options)

        def counting_add(upload: light_upload.LightUpload, lights: Any, textures: Any) -> None:
            self.lights += 1
            add(upload, lights, textures)

        monkeypatch.setattr(core, "build", counting_build)
        monkeypatch.setattr(light_upload.LightUpload, "add", counting_add)

    def during(self, function: Callable[[], object]) -> tuple[int, int]:
        before = self.built, self.lights
        function()
        return self.built - before[0], self.lights - before[1]


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    return Calls(monkeypatch)


def a_stage(folder: Path, kind: str = "", seed: int = 1) -> Usd.Stage:
    r = random.Random(seed)
    image = folder / "chequers.png"
    write_chequers(image)
    stage = stage_of(r, str(image))
    for k in range(6):  # a plain cage need not stay
        stage.GetPrimAtPath(f"/world/g{k % 2}/m{k}").GetAttribute("subdivisionScheme").Set("none")
    if kind:
        COSTLY[kind](stage, r, str(image))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/eyes/cam"))
    camera.GetPrim().CreateAttribute("primray:nearest", Sdf.ValueTypeNames.Double).Set(2.0)
    camera.CreateFocalLengthAttr().Set(18.0)
    place(stage, (0.0, 1.0, 9.0))
    return stage


def place(stage: Usd.Stage, at: tuple[float, float, float]) -> None:
    stage.GetPrimAtPath("/eyes/cam").GetAttribute("xformOp:translate").Set(Gf.Vec3d(*at))


def is_new(scene: primray.Scene, stage: Usd.Stage, settings: RenderSettings = SETTINGS) -> bool:
    one, other = scene.render(settings), primray.render(stage, settings)
    return bool(one.report["pixels_sha256"] == other.report["pixels_sha256"])


@pytest.mark.parametrize("kind", COSTLY)
def test_a_step_builds_nothing_and_hands_over_no_light(kind: str, calls: Calls, tmp_path: Path) -> None:
    stage = a_stage(tmp_path, kind)
    scene = primray.Scene(stage)
    assert is_new(scene, stage)
    place(stage, (0.02, 1.02, 9.02))
    assert calls.during(lambda: scene.render(SETTINGS)) == (0, 0)
    assert is_new(scene, stage)


@pytest.mark.parametrize("kind", ["cages in instances", "displaced cages", "NURBS", "ribbons"])
def test_another_grid_point_dices_again(kind: str, calls: Calls, tmp_path: Path) -> None:
    stage = a_stage(tmp_path, kind)
    scene = primray.Scene(stage)
    assert is_new(scene, stage)
    place(stage, (0.0, 1.0, 7.7))
    assert calls.during(lambda: scene.render(SETTINGS))[0] == 1
    assert is_new(scene, stage)


def test_instances_that_move_are_diced_again(tmp_path: Path) -> None:
    stage = a_stage(tmp_path, "cages in instances")
    scene = primray.Scene(stage)
    assert is_new(scene, stage)
    UsdGeom.PointInstancer(stage.GetPrimAtPath("/world/g0/crowd")).CreateScalesAttr([Gf.Vec3f(2.0)] * 5)
    assert is_new(scene, stage)


def test_displacements_that_change_are_diced_again(tmp_path: Path) -> None:
    stage = a_stage(tmp_path, "displaced cages")
    scene = primray.Scene(stage)
    assert is_new(scene, stage)
    stage.GetPrimAtPath("/mats/moved/texture").GetAttribute("inputs:scale").Set(Gf.Vec4f(0.4))
    assert is_new(scene, stage)
    write_chequers(tmp_path / "chequers.png", 90)
    assert is_new(scene, stage)


def test_one_of_several_displaced_cages_goes(tmp_path: Path) -> None:
    """What is reported of the one that is left is that of a new render."""
    stage = a_stage(tmp_path, "displaced cages")
    scene = primray.Scene(stage)
    assert is_new(scene, stage)
    stage.RemovePrim("/world/g1/displaced")
    image, new = scene.render(SETTINGS), primray.render(stage, SETTINGS)
    assert image.report["diagnostics"] == new.report["diagnostics"]
    assert image.report["pixels_sha256"] == new.report["pixels_sha256"]


def test_volumes_stay(calls: Calls, tmp_path: Path) -> None:
    write(tmp_path, grid(0.5))
    file = tmp_path / "stage.usda"
    file.write_text(f"""#usda 1.0
(upAxis = "Y")
{volume_text()}
def SphereLight "lamp" {{
    float inputs:intensity = 500
    double3 xformOp:translate = (4, 20, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Xform "eyes" {{
    def Camera "cam" {{
        double primray:nearest = 8
        double3 xformOp:translate = (4, 4, 30)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
""")
    stage = Usd.Stage.Open(str(file))
    scene = primray.Scene(stage)
    assert is_new(scene, stage)
    place(stage, (4, 4, 30.1))
    assert calls.during(lambda: scene.render(SETTINGS)) == (0, 0)
    assert is_new(scene, stage)
    stage.GetPrimAtPath("/lamp").GetAttribute("inputs:intensity").Set(100.0)
    assert calls.during(lambda: scene.render(SETTINGS)) == (0, 1)
    assert is_new(scene, stage)


def write_noise(path: Path) -> str:
    texels = np.random.default_rng(2).random((256, 256, 3), np.float32) ** 4
    image = oiio.ImageBuf(oiio.ImageSpec(256, 256, 3, "half"))
    image.set_pixels(oiio.ROI(0, 256, 0, 256), texels)
    assert image.write(str(path))
    return str(path)


def a_glowing_pattern(stage: Usd.Stage, image: str) -> UsdShade.Material:
    """Emission that is a product of an image and noise, which no input alone can hold."""
    color, made = Sdf.ValueTypeNames.Color3f, UsdShade.Material.Define(stage, "/mats/glow")

    def node(name: str, kind: str) -> UsdShade.Shader:
        shader = UsdShade.Shader.Define(stage, f"/mats/glow/{name}")
        shader.CreateIdAttr(kind)
        return shader

    texels, noise, product = (
        node("texels", "ND_image_color3"),
        node("noise", "ND_noise2d_color3"),
        node("by", "ND_multiply_color3"),
    )
    texels.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(image)
    product.CreateInput("in1", color).ConnectToSource(texels.ConnectableAPI(), "out")
    product.CreateInput("in2", color).ConnectToSource(noise.ConnectableAPI(), "out")
    surface = node("surface", "ND_standard_surface_surfaceshader")
    surface.CreateInput("emission", Sdf.ValueTypeNames.Float).Set(3.0)
    surface.CreateInput("emission_color", color).ConnectToSource(product.ConnectableAPI(), "out")
    made.CreateSurfaceOutput("mtlx").ConnectToSource(surface.ConnectableAPI(), "out")
    return made


def test_means_of_patterns_are_those_of_the_view(tmp_path: Path) -> None:
    """Levels of images that emission is computed from depend on the camera, and the choice of triangles on their means."""
    stage = a_stage(tmp_path, "emissive mesh")
    material = a_glowing_pattern(stage, write_noise(tmp_path / "noise.exr"))
    for path in ("/world/g0/grid", "/world/g1/m1"):
        UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(path)).Bind(material)
    stage.GetPrimAtPath("/eyes/cam").GetAttribute("primray:nearest").Set(64.0)
    scene = primray.Scene(stage)
    for far in (9.0, 60.0, 9.5, 61.0):
        place(stage, (0.0, 1.0, far))
        assert is_new(scene, stage), far
