"""Splines and value clips count wherever time samples do: default time, poses, the shutter, what inspect says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pxr import Usd

from primray.description import SceneDescription
from primray.diagnostics import Diagnostics
from primray.settings import RenderSettings
from primray.usd import open_stage, stage_facts, translate
from primray.usd.stage.time_varying import earliest_if_unset, has_time_values, is_below_clips, varies

from ..usd_text import stage_of, translate_text

SPLINE = "spline = {\n 2: 3; post linear,\n 10: 5; post linear,\n }"
SAMPLES = "timeSamples = {\n 2: 3,\n 10: 5,\n }"
BODIES = {
    "transform": 'def Xform "a"\n{{\n double xformOp:translateX.{0}\n uniform token[] xformOpOrder = ["xformOp:translateX"]\n'
    ' def Cube "c"\n {{\n }}\n}}\n',
    "shape": 'def Sphere "a"\n{{\n double radius.{0}\n}}\n',
    "light": 'def Camera "eye"\n{{\n}}\ndef SphereLight "a"\n{{\n float inputs:intensity.{0}\n float inputs:radius.{0}\n}}\n',
    "camera": 'def Xform "r"\n{{\n double xformOp:rotateY.{0}\n uniform token[] xformOpOrder = ["xformOp:rotateY"]\n'
    ' def Camera "a"\n {{\n  float focalLength.{0}\n }}\n}}\n',
    "shader": 'def Material "m"\n{{\n token outputs:surface.connect = </m/s.outputs:surface>\n def Shader "s"\n {{\n'
    '  uniform token info:id = "UsdPreviewSurface"\n  float inputs:ior.{0}\n  token outputs:surface\n }}\n}}\n'
    'def Cube "c" (\n prepend apiSchemas = ["MaterialBindingAPI"]\n)\n{{\n rel material:binding = </m>\n}}\n',
}


def text_of(body: str, times: str) -> str:
    return BODIES[body].format(times)


@pytest.mark.parametrize("time", [None, 2.0, 6.0])
@pytest.mark.parametrize("body", list(BODIES))
def test_splines_are_read_as_their_samples_are(body: str, time: float | None) -> None:
    settings = RenderSettings(time_code=time, resolution=(20, 20))
    found, expected = (translate_text(text_of(body, times), settings) for times in (SPLINE, SAMPLES))
    assert seen(found[0]) == seen(expected[0])
    assert found[1] == expected[1]


def seen(description: SceneDescription) -> Any:
    d = description
    where = [p.matrix.round(6).tolist() for p in d.static]
    shapes = [tuple(tuple(v.round(5).tolist()) for v in shape.box()) for shape in d.shapes]
    camera = (d.camera.world_from_camera.round(3).tolist(), [round(x, 6) for x in d.camera.window])
    return where, shapes, camera, d.surfaces, [(light.emission, light.world_from_light.tolist()) for light in d.lights]


def test_a_slope_before_the_first_knot_is_not_followed_to_its_end() -> None:
    text = text_of("shape", SPLINE.replace("{", "{\n pre: linear,", 1))
    stage = stage_of(text)
    attribute = stage.GetPrimAtPath("/a").GetAttribute("radius")
    assert earliest_if_unset(attribute) == Usd.TimeCode(2)
    assert seen(translate_text(text)[0])[1] == [((-3, -3, -3), (3, 3, 3))]


def test_a_default_is_preferred_to_a_spline() -> None:
    assert seen(translate_text(text_of("shape", f"{SPLINE}\n double radius = 7"))[0])[1] == [((-7, -7, -7), (7, 7, 7))]


@pytest.mark.parametrize(("opens", "closes", "moves"), [(2, 2.5, True), (-3, 1, False), (12, 13, False), (5, 7, True)])
@pytest.mark.parametrize("times", [SPLINE, SAMPLES])
def test_changes_within_a_span(times: str, opens: float, closes: float, moves: bool) -> None:
    stage = stage_of(text_of("shape", times))
    attribute = stage.GetPrimAtPath("/a").GetAttribute("radius")
    assert has_time_values(attribute)
    assert varies(attribute, opens, closes) is moves


def test_a_curve_that_comes_back_changes() -> None:
    stage = stage_of('def Sphere "a"\n{\n double radius.spline = {\n 0: 1; post linear,\n 1: 3; post linear,\n 2: 1,\n }\n}\n')
    assert varies(stage.GetPrimAtPath("/a").GetAttribute("radius"), 0, 2)


@pytest.mark.parametrize("times", [SPLINE, SAMPLES])
@pytest.mark.parametrize("body", ["transform", "shape"])
def test_the_shutter_sees_what_moves(body: str, times: str) -> None:
    camera = 'def Camera "cam"\n{\n double shutter:open = -0.5\n double shutter:close = 0.5\n}\n'
    assert translate_text(camera + text_of(body, times), RenderSettings(time_code=5.0))[0].exposure is not None
    assert translate_text(camera + text_of(body, times), RenderSettings(time_code=20.0))[0].exposure is None


@pytest.mark.parametrize("times", [SPLINE, SAMPLES])
def test_inspect_says_from_when_to_when(times: str) -> None:
    assert stage_facts(stage_of(text_of("shape", times)))["time"]["sampled"] == [2, 10]


@pytest.mark.parametrize("time", [None, 6.0])
def test_skeletons_are_posed_where_splines_put_them(time: float | None) -> None:
    def pose(times: str) -> Any:
        return seen(translate_text(text_of("transform", times).replace("Xform", "SkelRoot"), RenderSettings(time_code=time))[0])

    assert pose(SPLINE) == pose(SAMPLES)


def clipped(folder: Path, depth: int) -> Usd.Stage:
    """A cube with clips, below so many prims."""
    (folder / "topology.usda").write_text('#usda 1.0\n(\n defaultPrim = "c"\n)\ndef Cube "c"\n{\n double size\n}\n')
    (folder / "clip.usda").write_text('#usda 1.0\ndef "c"\n{\n double size.timeSamples = {\n 1: 6,\n 5: 1,\n }\n}\n')
    clips = """clips = { dictionary default = {
        double2[] active = [(1, 0)]
        asset[] assetPaths = [@./clip.usda@]
        asset manifestAssetPath = @./topology.usda@
        string primPath = "/c"
        double2[] times = [(1, 1), (5, 5)]
    } }"""
    body = f'def "c" (\n references = @./topology.usda@\n {clips}\n)\n{{\n}}\n'
    for k in range(depth):
        body = f'def Xform "x{k}"\n{{\n{body}}}\n'
    (folder / "root.usda").write_text(f"#usda 1.0\n{body}")
    return open_stage(folder / "root.usda", Diagnostics())


@pytest.mark.parametrize("depth", [0, 1, 3])
def test_clips_count_at_any_depth(tmp_path: Path, depth: int) -> None:
    stage = clipped(tmp_path, depth)
    assert seen(translate(stage, RenderSettings())[0])[1] == [((-3, -3, -3), (3, 3, 3))]
    assert stage_facts(stage)["time"]["sampled"] == [1, 5]
    (holder,) = (prim for prim in stage.Traverse() if prim.GetName() == "c")
    assert is_below_clips(holder)
    assert not is_below_clips(holder.GetParent())
