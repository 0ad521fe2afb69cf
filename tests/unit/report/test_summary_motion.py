"""What reports say of motion: of stages in which one thing of each kind moves."""

from __future__ import annotations

from typing import Any

import pytest
from pxr import Usd

from primray.cli.commands.inspect import _motion_rows
from primray.report.summary import motion_facts
from primray.settings import RenderSettings
from primray.usd import translate

SHIFT = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 0.25: (0, 1, 0), 1: (3, 1, 0) }"
TURN = "float xformOp:rotateZ.timeSamples = { 0: 0, 1: 90 }"
ORDERS = {SHIFT: "translate", TURN: "rotateZ", "": "translate"}


def prim(kind: str, name: str, moves: str = "", body: str = "") -> str:
    return (
        f'def {kind} "{name}"\n{{\n{moves}\nuniform token[] xformOpOrder = ["xformOp:{ORDERS[moves]}"]\n{body}\n}}\n'
        if moves
        else (f'def {kind} "{name}"\n{{\n{body}\n}}\n')
    )


def camera(moves: str = "", close: float = 1.0) -> str:
    return prim("Camera", "cam", moves, f"double shutter:close = {close}")


def facts_of(text: str) -> dict[str, Any] | None:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(f"#usda 1.0\n{text}")
    description, _ = translate(stage, RenderSettings(time_code=0.0, resolution=(64, 36), camera="/cam"))
    return motion_facts(description)


POINTS = "point3f[] points.timeSamples = { 0: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], 1: [(0, 0, 1), (1, 0, 0), (0, 1, 0)] }"
MESH = f"int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n{POINTS}"
MOVING = {
    "instances": (camera() + prim("Cube", "x", SHIFT), 4, "samples", "/x"),
    "meshes": (camera() + prim("Mesh", "x", "", MESH), 1, "samples", "/x"),
    "lights": (camera() + prim("Cube", "c") + prim("SphereLight", "x", SHIFT), 4, "samples", "/x"),
    "camera": (camera(SHIFT) + prim("Cube", "c"), 4, "samples", "/cam"),
}


@pytest.mark.parametrize("kind", MOVING)
def test_what_moves_is_told(kind: str) -> None:
    text, segments, why, path = MOVING[kind]
    facts = facts_of(text)
    assert facts is not None
    assert facts["shutter"] == facts["span"] == [0.0, 1.0]
    assert list(facts["moving"]) == [kind]
    found = facts["moving"][kind]
    assert (found["count"], found["segments"], found["why"], found["path"]) == (1, segments, why, path)
    assert 0.0 <= found["error_pixels"] <= 0.02
    rows = dict(_motion_rows(facts))
    assert rows["shutter"] == "0 to 1 time codes from the frame"
    assert rows["moving"].startswith(f"{kind} 1: {path} in {segments} step")


def test_steps_for_the_error_are_told_apart() -> None:
    light = prim("RectLight", "x", TURN)
    facts = facts_of(camera() + prim("Xform", "t", TURN, prim("Mesh", "x", "", MESH)) + light)
    assert facts is not None
    assert set(facts["moving"]) == {"instances", "meshes", "lights"}
    facts = facts_of(camera() + prim("Xform", "a", TURN, prim("Xform", "b", SHIFT, prim("Cube", "x"))))
    assert facts is not None
    assert facts["moving"]["instances"]["why"] == "error"


@pytest.mark.parametrize(
    "text", [camera() + prim("Cube", "x"), camera("", 0.0) + prim("Cube", "x", SHIFT)], ids=["rests", "closed"]
)
def test_where_nothing_moves_there_is_nothing_to_tell(text: str) -> None:
    assert facts_of(text) is None
    assert not list(_motion_rows(None))
