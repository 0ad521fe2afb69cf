"""Domes of a scene that stays: their image and tables stay in the core, as long as nothing that they depend on changes."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux

import primray
from primray.core import light_upload

from ...properties.random_edits import stage_of
from ...properties.test_kept_scenes import write_chequers

pytestmark = pytest.mark.filterwarnings("ignore::primray.RenderWarning")
SETTINGS = primray.RenderSettings(resolution=(32, 18), spp=2, threads=1, camera="/eyes/cam")


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    """With two domes of one image, one of another, and a constant one."""
    made = stage_of(random.Random(4))
    write_chequers(tmp_path / "sky.png")
    write_chequers(tmp_path / "other.png", 90)
    for name, image in (("a", "sky.png"), ("b", "sky.png"), ("c", "other.png"), ("d", "")):
        dome = UsdLux.DomeLight.Define(made, f"/domes/{name}")
        dome.CreateIntensityAttr(0.3)
        if image:
            dome.CreateTextureFileAttr(str(tmp_path / image))
    return made


@pytest.fixture
def handed_over(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the images whose texels are handed over to the core."""
    names: list[str] = []
    given = light_upload.light_pixels

    def noted(file: Any, textures: Any) -> Any:
        names.append("" if file is None else Path(file.path).name)
        return given(file, textures)

    monkeypatch.setattr(light_upload, "light_pixels", noted)
    return names


def dome(stage: Usd.Stage, name: str) -> UsdLux.DomeLight:
    return UsdLux.DomeLight(stage.GetPrimAtPath(f"/domes/{name}"))


def nothing(stage: Usd.Stage) -> None:
    place = stage.GetPrimAtPath("/eyes/cam").GetAttribute("xformOp:translate")
    place.Set(place.Get() + Gf.Vec3d(0.001, 0.001, -0.001))


def far_away(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/eyes/cam").GetAttribute("xformOp:translate").Set(Gf.Vec3d(40, 0, 90))


def turned(stage: Usd.Stage) -> None:
    UsdGeom.Xformable(dome(stage, "a")).AddRotateYOp().Set(70.0)


def brighter(stage: Usd.Stage) -> None:
    dome(stage, "c").GetIntensityAttr().Set(2.0)


def swapped(stage: Usd.Stage) -> None:
    a, c = (dome(stage, name).GetTextureFileAttr() for name in "ac")
    one, other = a.Get().path, c.Get().path
    a.Set(other), c.Set(one)


def dark(stage: Usd.Stage) -> None:
    UsdLux.LightAPI(stage.GetPrimAtPath("/domes/b")).CreateDiffuseAttr(0.0)
    UsdLux.LightAPI(stage.GetPrimAtPath("/domes/b")).CreateSpecularAttr(0.0)


def linked(stage: Usd.Stage) -> None:
    light = UsdLux.LightAPI(stage.GetPrimAtPath("/domes/c"))
    light.GetLightLinkCollectionAPI().CreateIncludeRootAttr(False)
    light.GetLightLinkCollectionAPI().IncludePath("/world/g0")


def gone(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/domes/a").SetActive(False)


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (nothing, []),
        (far_away, []),
        (turned, []),
        (gone, ["sky.png"]),  # read again, for another light
        (brighter, ["other.png"]),
        (swapped, ["other.png", "sky.png", "sky.png"]),
        (dark, ["sky.png"]),
        (linked, ["other.png"]),
    ],
)
def test_tables_are_made_again_only_where_they_change(
    edit: Any, expected: list[str], stage: Usd.Stage, handed_over: list[str]
) -> None:
    scene = primray.Scene(stage)
    before = scene.render(SETTINGS)
    assert sorted(handed_over) == ["", "other.png", "sky.png", "sky.png"]
    for _ in range(2):  # and where they stay, they stay again
        handed_over.clear()
        edit(stage) if edit is not None else None
        image = scene.render(SETTINGS)
        assert sorted(handed_over) == expected
        new = primray.render(stage, SETTINGS)
        assert image.report["pixels_sha256"] == new.report["pixels_sha256"] != before.report["pixels_sha256"]
        edit, expected = nothing, []


def test_an_image_that_is_written_again_is_handed_over_again(stage: Usd.Stage, handed_over: list[str], tmp_path: Path) -> None:
    scene = primray.Scene(stage)
    scene.render(SETTINGS)
    handed_over.clear()
    write_chequers(tmp_path / "sky.png", 200)
    image = scene.render(SETTINGS)
    assert handed_over.count("sky.png") == 2
    assert image.report["pixels_sha256"] == primray.render(stage, SETTINGS).report["pixels_sha256"]


def test_portals_are_weighed_again_beside_another_light(stage: Usd.Stage, handed_over: list[str]) -> None:
    portal = UsdLux.PortalLight.Define(stage, "/domes/portal")
    portal.AddTranslateOp().Set(Gf.Vec3d(0, 3, 0))
    dome(stage, "c").CreatePortalsRel().AddTarget("/domes/portal")
    scene = primray.Scene(stage)
    scene.render(SETTINGS)
    handed_over.clear()
    stage.GetPrimAtPath("/world/g1/SphereLight").GetAttribute("inputs:intensity").Set(3.0)
    image = scene.render(SETTINGS)
    assert handed_over == ["other.png"]
    assert image.report["pixels_sha256"] == primray.render(stage, SETTINGS).report["pixels_sha256"]
