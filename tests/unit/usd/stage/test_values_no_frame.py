"""Without a frame whatever has no default counts by its earliest value, as if that were authored, also where USD reads it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import OpenImageIO as oiio
import pytest
from tests.translation.describe import describe

from primray.settings import RenderSettings
from primray.usd import LabelledPrims, count_undrawn_shapes, translate

from ..usd_text import stage_of

ORDER = 'uniform token[] xformOpOrder = ["xformOp:translate"]\n'
AWAY = "double3 xformOp:translate.timeSamples = {0: (0, 0, 10), 5: (0, 0, 50)}\n" + ORDER
CAMERA = 'def Camera "eye" (\nAPI\n)\n{\nBODY\n}\n'
LEVELS = """def Xform "tree" (
    prepend apiSchemas = ["LODRootAPI", "LODOverrideAPI"]
)
{
    rel lod:heuristics = </tree/rule>
    ROOT
    def RULE "rule"
    {
        uniform token lod:domain = "imaging"
        HOW
    }
    def Sphere "a"
    {
    }
    def Cube "b"
    {
    }
    def Cone "c"
    {
    }
}
"""
PLATED = 'prepend apiSchemas = ["BackPlateAPI:sky"]'
LAMP = 'def Cube "box"\n{\n}\ndef GeometryLight "lamp"\n{\nrel geometry = </box>\nBODY\n}\n'


def levels(how: str, camera: str = AWAY, rule: str = "LODDistanceHeuristic", root: str = "") -> str:
    text = LEVELS.replace("RULE", rule).replace("HOW", how).replace("ROOT", root)
    return CAMERA.replace("API\n", "").replace("BODY", camera) + text


STAGES = {
    "place of the camera": levels("uniform float[] thresholds = [8, 12]"),
    "place of the root": levels("uniform float[] thresholds = [8, 12]", "", root=AWAY),
    "centre": levels("uniform float[] thresholds = [8, 12]\npoint3f center.timeSamples = {0: (0, 0, 9), 5: (0, 0, 1)}", ""),
    "thresholds": levels(
        "float[] thresholds.timeSamples = {0: [1, 100], 5: [100, 200]}",
        AWAY.replace(".timeSamples", "").replace("{0: (0, 0, 10), 5: (0, 0, 50)}", "(0, 0, 10)"),
    ),
    "lens": levels(
        "uniform float[] thresholds = [0.3, 0.1]",
        f"float focalLength.timeSamples = {{0: 20, 5: 200}}\n{AWAY}",
        "LODScreenSizeHeuristic",
    ),
    "extent": levels(
        "uniform float[] thresholds = [0.3, 0.1]\n"
        "float3[] extent.timeSamples = {0: [(-2, -2, -2), (2, 2, 2)], 5: [(-9, -9, -9), (9, 9, 9)]}",
        AWAY,
        "LODScreenSizeHeuristic",
    ),
    "bounding volume": levels(
        "uniform float[] thresholds = [0.3, 0.1]\nrel boundingVolume = </hull>", AWAY, "LODScreenSizeHeuristic"
    )
    + 'class Cube "hull"\n{\nfloat3[] extent.timeSamples = {0: [(-2, -2, -2), (2, 2, 2)], 5: [(-9, -9, -9), (9, 9, 9)]}\n}\n',
    "override": levels("", root='token lod:override:mode.timeSamples = {0: "noLOD", 5: "allLOD"}'),
    "overriding index": levels(
        "", root='uniform token lod:override:mode = "indexedLOD"\nfloat lod:override:index.timeSamples = {0: 2, 5: 0}'
    ),
    "default index": levels("", root="int lod:default:index.timeSamples = {0: 1, 5: 2}"),
    "place of a plate": CAMERA.replace("API", PLATED).replace(
        "BODY", "float3 backPlate:sky:translate:tweak.timeSamples = {0: (1, 0, 0), 5: (2, 0, 0)}"
    ),
    "distance of a plate": CAMERA.replace("API", PLATED).replace("BODY", "float focusDistance.timeSamples = {0: 7, 5: 9}"),
    "a plate is muted": CAMERA.replace("API", PLATED).replace(
        "BODY", 'token backPlate:sky:plateVisibility.timeSamples = {0: "mute", 5: "all"}'
    ),
    "a light is hidden": LAMP.replace("BODY", 'token visibility.timeSamples = {0: "invisible", 5: "inherited"}'),
    "a light is hidden from above": 'def Xform "all"\n{\ntoken visibility.timeSamples = {0: "invisible", 5: "inherited"}\n'
    + LAMP.replace("BODY", "").replace("</box>", "</all/box>")
    + "}\n",
    "brightness of a light": LAMP.replace("BODY", "float inputs:intensity.timeSamples = {0: 3, 5: 4}"),
}


def drawn(text: str, time_code: float | None = None) -> str:
    description, _ = translate(stage_of(text), RenderSettings(resolution=(8, 8), time_code=time_code))
    return describe(replace(description, time_code=None), [], "no file")


def written_out(text: str) -> str:
    """With the first of all samples as default."""
    return re.sub(r"\.timeSamples = \{0: (.*), 5: [^{}]*\}", r" = \1", text)


@pytest.mark.parametrize("text", STAGES.values(), ids=STAGES)
def test_the_earliest_value_counts(text: str) -> None:
    by_hand = written_out(text)
    assert "timeSamples" not in by_hand
    assert drawn(text) == drawn(by_hand) == drawn(text, 0)
    assert drawn(text) != drawn(text, 5)


def test_the_earliest_image_of_a_plate_counts(tmp_path: Path) -> None:
    for name in "ab":
        file = oiio.ImageBuf(oiio.ImageSpec(2, 2, 3, "uint8"))
        assert file.write(str(tmp_path / f"{name}.png"))
    body = f"asset backPlate:sky:image.timeSamples = {{0: @{tmp_path}/a.png@, 5: @{tmp_path}/b.png@}}"
    test_the_earliest_value_counts(CAMERA.replace("API", PLATED).replace("BODY", body))


def test_why_nothing_is_drawn() -> None:
    stage = stage_of('def Cube "box"\n{\ntoken visibility.timeSamples = {0: "invisible", 5: "inherited"}\n}\n')
    assert count_undrawn_shapes(stage, RenderSettings()) == {"invisible at this frame": 1}
    assert count_undrawn_shapes(stage, RenderSettings(time_code=5)) == {"": 1}


def test_labels() -> None:
    head = 'def Cube "box" (\nprepend apiSchemas = ["SemanticsLabelsAPI:kind"]\n)\n'
    stage = stage_of(head + '{\ntoken[] semantics:labels:kind.timeSamples = {0: ["tree"], 5: ["car"]}\n}\n')
    assert LabelledPrims(stage, None).inherited("/box", "", "kind") == ("tree",)
    assert LabelledPrims(stage, 5.0).inherited("/box", "", "kind") == ("car",)
