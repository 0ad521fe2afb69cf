"""What a check tells of a scene: what the page offers, and the warnings of a job that would render it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.service.worker.checking import SPHERE, Checked, Files, check, usda

from primray.diagnostic_codes import Kind

KINDS = {kind.value for kind in Kind}
SHOT = """
def Xform "world" (
    variantSets = "look"
    variants = { string look = "red" }
) {
    def Sphere "ball" {
        double radius.timeSamples = { 1: 1, 24: 2 }
    }
    def SphereLight "key" {
    }
    def Camera "wide" {
        float horizontalAperture = 40
        float verticalAperture = 20
    }
    def Camera "close" {
    }
    def Shader "texture" {
        asset inputs:file = @tex/missing.png@
    }
    def GenerativeProcedural "hair" {
    }
    variantSet "look" = {
        "red" {
        }
        "blue" {
        }
    }
}
def Scope "Render" {
    def RenderSettings "settings" {
        rel camera = </world/close>
        int2 resolution = (1280, 720)
        rel products = [</Render/beauty>, </Render/bad>, </Render/worse>]
    }
    def RenderProduct "beauty" {
        token productName = "beauty.exr"
        rel orderedVars = [</Render/color>]
    }
    def RenderProduct "bad" {
        token productName = "/etc/cron.d/x"
    }
    def RenderProduct "worse" {
        token productName = "out/../../x"
    }
    def RenderVar "color" {
    }
}
"""
HEAD = 'startTimeCode = 1\nendTimeCode = 24\nframesPerSecond = 25\nupAxis = "Z"\nmetersPerUnit = 1\ndefaultPrim = "world"'


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Checked:
    files: Files = {"shot.usda": usda(SHOT, HEAD), "tex/there.png": b"1234", "notes.txt": "x"}
    return check(tmp_path_factory.mktemp("check") / "slot", files)


@pytest.fixture
def facts(shot: Checked) -> dict[str, Any]:
    assert shot.facts is not None, shot
    return shot.facts


def test_files_and_entry(facts: dict[str, Any]) -> None:
    assert (facts["entry"], facts["entries"], facts["layers"]) == ("shot.usda", ["shot.usda"], ["shot.usda"])
    assert [(file["name"], file["kind"]) for file in facts["files"]] == [
        ("notes.txt", "other"),
        ("shot.usda", "usda"),
        ("tex/there.png", "image"),
    ]
    assert facts["files"][2]["bytes"] == 4


def test_cameras_and_settings(facts: dict[str, Any]) -> None:
    assert [(camera["path"], camera["name"]) for camera in facts["cameras"]] == [
        ("/world/wide", "wide"),
        ("/world/close", "close"),
    ]
    assert facts["cameras"][0]["aspect"] == pytest.approx(2)
    assert (facts["camera"], facts["resolution"]) == ("/world/close", [1280, 720])
    (settings,) = facts["render_settings"]
    assert (settings["path"], settings["camera"], settings["resolution"]) == ("/Render/settings", "/world/close", [1280, 720])
    assert settings["products"][0] == {
        "path": "/Render/beauty",
        "name": "beauty.exr",
        "type": "raster",
        "vars": ["/Render/color"],
    }


def test_times_and_units(facts: dict[str, Any]) -> None:
    assert facts["frame_range"] == {"start": 1, "end": 24, "fps": 25, "sampled": True}
    assert (facts["up_axis"], facts["meters_per_unit"], facts["default_prim"]) == ("Z", 1, "/world")


def test_counts_and_variants(facts: dict[str, Any]) -> None:
    assert facts["counts"]["lights"] == 1
    assert facts["counts"]["cameras"] == 2
    assert facts["counts"]["layers"] == 1
    assert facts["variants"] == [{"prim": "/world", "set": "look", "selection": "red", "names": ["blue", "red"]}]


def test_warnings(shot: Checked) -> None:
    found = {(warning["code"], warning["prim"]) for warning in shot.warnings}
    assert found == {
        ("asset-not-uploaded", ""),
        ("product-name-rewritten", "/Render/bad"),
        ("product-name-rewritten", "/Render/worse"),
        ("unsupported-prim", "/world/hair"),
    }
    assert all(warning["kind"] in KINDS for warning in shot.warnings)
    assert "'tex/missing.png'" in next(w["detail"] for w in shot.warnings if w["code"] == "asset-not-uploaded")


def test_many_warnings_are_cut_off(tmp_path: Path) -> None:
    textures = "".join(f'def Shader "t{n}" {{\n  asset inputs:file = @{n}.png@\n}}\n' for n in range(1000))
    found = check(tmp_path / "slot", {"scene.usda": usda(SPHERE + textures)})
    assert len(found.warnings) == 301
    assert found.warnings[-1]["code"] == "more-warnings"


def test_a_scene_without_cameras_and_times(tmp_path: Path) -> None:
    found = check(tmp_path / "slot", {"scene.usda": usda(SPHERE)})
    assert found.facts is not None
    assert (found.facts["cameras"], found.facts["camera"], found.facts["render_settings"]) == ([], None, [])
    assert found.facts["frame_range"] == {"start": None, "end": None, "fps": 24, "sampled": False}
    assert found.warnings == []
