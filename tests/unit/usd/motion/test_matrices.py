"""What moves by its transforms, against UsdGeomXformCache at many times: the true path, within the error that is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from primray.description import MovingInstances, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of
from .reference import world_at

FRAME = 5.0
CAMERA = """def Camera "cam"
{
    double shutter:open = -0.5
    double shutter:close = 0.5
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
RESOLUTION = (640, 360)


def prim(name: str, ops: dict[str, str], more: str = "", kind: str = "Xform") -> str:
    """Its operations by `type name` with their values or samples, in this order."""
    names = ", ".join(f'"{op.split()[1].split(".")[0]}"' for op in ops)
    lines = "\n".join(f"    {op} = {value}" for op, value in ops.items())
    return f'def {kind} "{name}"\n{{\n{lines}\n    uniform token[] xformOpOrder = [{names}]\n{more}\n}}\n'


CUBE = 'def Cube "c"\n{\n}\n'


def translated(text: str, camera: str = CAMERA, **settings: Any) -> tuple[SceneDescription, Usd.Stage]:
    stage = stage_of(camera + text)
    chosen: dict[str, Any] = {"time_code": FRAME, "resolution": RESOLUTION, "camera": "/cam", **settings}
    description, _ = translate(stage, RenderSettings(**chosen))
    return description, stage


def pixels_off(d: SceneDescription, stage: Usd.Stage, path: str, blur_scale: float = 1.0) -> float:
    """The most that a corner of the shape is off at any of many times."""
    (shape,) = {shape.path: shape for shape in d.shapes if shape.path == path}.values()
    low, high = shape.box()
    corners = np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2], 1] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    worst = 0.0
    assert d.exposure is not None
    first, last = d.exposure.span
    for fraction in np.linspace(0, 1, 97):
        time = FRAME + blur_scale * (first + fraction * (last - first))
        true = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(stage.GetPrimAtPath(path))).T
        (found,) = world_at(d, path, float(fraction))
        a, b = ((m @ corners.T).T[:, :3] for m in (found, true))
        worst = max(worst, float(np.abs(d.camera.project(a, RESOLUTION) - d.camera.project(b, RESOLUTION)).max()))
    return worst


PATHS = {
    "a translation": {"double3 xformOp:translate.timeSamples": "{ 0: (0, 0, 0), 10: (10, 5, 0) }"},
    "samples at unequal times": {
        "double3 xformOp:translate.timeSamples": "{ 4: (0, 0, 0), 4.6: (1, 0, 0), 4.7: (1, 1, 0), "
        "5.1: (2, -1, 0), 5.45: (0, 0, 0) }"
    },
    "a turn": {"double xformOp:rotateZ.timeSamples": "{ 0: 0, 10: 500 }"},
    "three turns": {"double xformOp:rotateY.timeSamples": "{ 4.5: 0, 5.5: 1080 }"},
    "a quarter turn, orient": {"quatd xformOp:orient.timeSamples": "{ 4: (1, 0, 0, 0), 6: (0, 0, 0, 1) }"},
    "a matrix": {
        "matrix4d xformOp:transform.timeSamples": "{ 4: ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)), "
        "6: ((0, 1, 0, 0), (-1, 0, 0, 0), (0, 0, 1, 0), (3, 0, 0, 1)) }"
    },
    "a scale through zero": {"float3 xformOp:scale.timeSamples": "{ 4.5: (-1, 1, 1), 5.5: (1, 1, 1) }"},
    "a scale from zero": {"float3 xformOp:scale.timeSamples": "{ 4.5: (0, 0, 0), 5.5: (1, 1, 1) }"},
    "a swing about a pivot": {
        "double3 xformOp:translate:pivot": "(3, 0, 0)",
        "double xformOp:rotateZ.timeSamples": "{ 4: 0, 5: 90, 6: 20 }",
        "double3 xformOp:translate": "(-3, 0, 0)",
    },
    "all at once": {
        "double3 xformOp:translate.timeSamples": "{ 4.2: (0, 0, 0), 5.3: (2, 1, 3) }",
        "float3 xformOp:rotateXYZ.timeSamples": "{ 4.7: (0, 0, 0), 5.2: (40, -30, 100) }",
        "float3 xformOp:scale.timeSamples": "{ 4.9: (1, 1, 1), 6: (3, 1, 0.5) }",
    },
}  # fmt: skip


@pytest.mark.parametrize("name", PATHS)
def test_paths_are_usds(name: str) -> None:
    d, stage = translated(prim("x", PATHS[name], CUBE))
    assert pixels_off(d, stage, "/x/c") < 0.1


def level_of(d: SceneDescription) -> MovingInstances:
    (placement,) = d.placements
    (level,) = placement.levels
    assert isinstance(level, MovingInstances)
    return level


def test_straight_paths_have_one_segment_and_turns_few() -> None:
    for name, segments, turns in (("a translation", 1, False), ("a matrix", 1, False), ("a turn", 1, True)):
        level = level_of(translated(prim("x", PATHS[name], CUBE))[0])
        assert (len(level.times) - 1, level.turns) == (segments, turns)
    assert len(level_of(translated(prim("x", PATHS["three turns"], CUBE))[0]).times) - 1 <= 8


def test_parents_and_children_move_together() -> None:
    inner = prim("y", PATHS["samples at unequal times"], CUBE)
    d, stage = translated(prim("x", PATHS["a turn"], prim("still", {"double3 xformOp:translate": "(2, 0, 0)"}, inner)))
    assert pixels_off(d, stage, "/x/still/y/c") < 0.1


def test_a_reset_leaves_out_what_moves_above() -> None:
    reset = prim("y", {"double3 xformOp:translate": "(2, 0, 0)"}, CUBE).replace('["xf', '["!resetXformStack!", "xf')
    d, _ = translated(prim("x", PATHS["a turn"], reset))
    assert d.exposure is None
    assert d.static[0].matrix[0, 3] == 2
    moving = prim("y", PATHS["a translation"], CUBE).replace('["xf', '["!resetXformStack!", "xf')
    d, stage = translated(prim("x", PATHS["a turn"], moving))
    assert pixels_off(d, stage, "/x/y/c") < 0.1


def test_what_moves_as_one_is_one_prototype() -> None:
    parts = "".join(prim(f"p{k}", {"double3 xformOp:translate": f"({k}, 0, 0)"}, kind="Cube") for k in range(20))
    d, stage = translated(prim("car", PATHS["a turn"], parts))
    assert (len(d.prototypes), len(d.placements), len(d.prototypes[0].shapes)) == (1, 1, 20)
    assert pixels_off(d, stage, "/car/p7") < 0.1


def test_an_extra_sample_on_the_line_changes_no_bit() -> None:
    plain, _ = translated(prim("x", {"double3 xformOp:translate.timeSamples": "{ 4: (0, 0, 0), 6: (8, 0, 0) }"}, CUBE))
    more, _ = translated(
        prim("x", {"double3 xformOp:translate.timeSamples": "{ 4: (0, 0, 0), 5.25: (5, 0, 0), 6: (8, 0, 0) }"}, CUBE)
    )
    a, b = level_of(plain), level_of(more)
    assert a.times.tolist() == b.times.tolist() == [0, 1]
    assert (a.matrices == b.matrices).all()
    assert (a.frame == b.frame).all()


def test_samples_that_bend_are_kept_where_they_are() -> None:
    d, _ = translated(
        prim("x", {"double3 xformOp:translate.timeSamples": "{ 4: (0, 0, 0), 5.25: (5, 0, 0), 6: (0, 0, 0) }"}, CUBE)
    )
    assert level_of(d).times.tolist() == [0, 0.25, 0.5, 0.75, 1]  # a grid of four has it


@pytest.mark.conforms("MotionAPI.motion:blurScale")
@pytest.mark.parametrize(("scale", "name"), [(0.5, "all at once"), (3.0, "samples at unequal times"), (2.0, "a turn")])
def test_blur_scale_is_about_the_frame(scale: float, name: str) -> None:
    api = f'def Scope "s" (apiSchemas = ["MotionAPI"])\n{{\nfloat motion:blurScale = {scale}\n'
    d, stage = translated(api + prim("x", PATHS[name], CUBE) + "}\n")
    assert pixels_off(d, stage, "/s/x/c", scale) < 0.1


def test_blur_scale_of_a_part_is_of_all_its_way() -> None:
    part = 'def Cube "c" (apiSchemas = ["MotionAPI"])\n{\nfloat motion:blurScale = 2\n}\n'
    d, stage = translated(prim("x", PATHS["all at once"], part + CUBE.replace("c", "d", 1)))
    assert pixels_off(d, stage, "/x/c", 2.0) < 0.1


def test_no_blur_stands_as_at_the_frame() -> None:
    part = 'def Cube "c" (apiSchemas = ["MotionAPI"])\n{\nfloat motion:blurScale = 0\n}\n'
    d, stage = translated(prim("x", PATHS["all at once"], part))
    assert d.exposure is None
    (found,) = world_at(d, "/x/c", 0.0)
    assert np.allclose(found, np.array(UsdGeom.XformCache(FRAME).GetLocalToWorldTransform(stage.GetPrimAtPath("/x/c"))).T)


def test_half_the_blur_is_half_the_shutter() -> None:
    api = 'def Scope "s" (apiSchemas = ["MotionAPI"])\n{\nfloat motion:blurScale = 0.5\n'
    moving = prim("x", PATHS["all at once"], CUBE)
    half, _ = translated(f"{api}{moving}}}\n", CAMERA.replace("open = -0.5", "open = 0").replace("close = 0.5", "close = 1"))
    short, _ = translated(f'def Scope "s"\n{{\n{moving}}}\n', CAMERA.replace("open = -0.5", "open = 0"))
    a, b = level_of(half), level_of(short)
    assert a.turns == b.turns
    assert np.array_equal(a.times, b.times)
    assert np.array_equal(a.matrices, b.matrices)


def test_without_motion_nothing_is_different() -> None:
    resting = prim("x", {"double3 xformOp:translate.timeSamples": "{ 6: (0, 0, 0), 10: (10, 5, 0) }"}, CUBE)
    d, _ = translated(resting)
    still, _ = translated(resting, CAMERA.replace("0.5", "0"))
    assert d.exposure is None
    assert (len(d.static), d.placements, d.prototypes) == (1, (), ())
    assert (d.static[0].matrix == still.static[0].matrix).all()


@pytest.mark.parametrize("shutter", [(0.25, 0.25), (-3.0, -3.0)])
def test_a_closed_shutter_is_a_still_at_its_instant(shutter: tuple[float, float]) -> None:
    d, stage = translated(prim("x", PATHS["all at once"], CUBE), shutter=shutter)
    assert d.exposure is None
    assert not d.placements
    true = np.array(UsdGeom.XformCache(FRAME + shutter[0]).GetLocalToWorldTransform(stage.GetPrimAtPath("/x/c"))).T
    assert np.allclose(d.static[0].matrix, true, atol=1e-12)


def test_without_motion_blur_it_is_one_at_the_frame() -> None:
    d, stage = translated(prim("x", PATHS["all at once"], CUBE), motion_blur=False)
    assert d.exposure is None
    assert d.camera.shutter == (0, 0)
    true = np.array(UsdGeom.XformCache(FRAME).GetLocalToWorldTransform(stage.GetPrimAtPath("/x/c"))).T
    assert np.allclose(d.static[0].matrix, true, atol=1e-12)


def test_aovs_widen_the_span_to_the_frame() -> None:
    moving = prim("x", PATHS["all at once"], CUBE)
    d, stage = translated(moving, shutter=(0.25, 0.75), aovs=("depth",))
    assert d.exposure is not None
    assert (d.exposure.span, d.exposure.shutter, d.exposure.frame) == ((0, 0.75), (0.25 / 0.75, 1), 0)
    assert pixels_off(d, stage, "/x/c") < 0.1
    alone, _ = translated(moving, shutter=(0.25, 0.75))
    assert alone.exposure is not None
    assert alone.exposure.span == (0.25, 0.75)


@pytest.mark.conforms("MotionAPI.motion:nonlinearSampleCount", state="no effect")
def test_a_closer_look_needs_more_steps() -> None:
    steps = [
        len(level_of(translated(prim("x", PATHS["all at once"], CUBE), motion_error=error)[0]).times) for error in (1.0, 0.01)
    ]
    assert steps[0] < steps[1]
