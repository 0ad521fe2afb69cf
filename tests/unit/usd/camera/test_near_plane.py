"""A near plane that cuts open what is in view is reported with where it would have to begin; closed shutters with vectors."""

from __future__ import annotations

import pytest

from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

CAMERA = """
def Camera "c"
{
    float2 clippingRange = (%g, 1000)
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def shape(kind: str, more: str = "") -> str:
    return f'def {kind} "body"\n{{\n    {more}\n}}\n'


CAGE = """point3f[] points = [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]"""
BODIES = {
    "sphere": shape("Sphere", "double radius = 1"),
    "cube": shape("Cube", "double size = 2"),
    "cage": shape("Mesh", CAGE),
    "turned": shape(
        "Cube",
        "double size = 1\n    float xformOp:rotateY = 45\n    float3 xformOp:scale = (2, 2, 2)\n    uniform token[] "
        'xformOpOrder = ["xformOp:scale", "xformOp:rotateY"]',
    ),
}
SIDES = 60  # of a mesh of so many small squares that they are not looked at one by one
GRID = [(x / SIDES * 2 - 1, y / SIDES * 2 - 1, 1) for y in range(SIDES + 1) for x in range(SIDES + 1)]
FACES = [r * (SIDES + 1) + c + k for r in range(SIDES) for c in range(SIDES) for k in (0, 1, SIDES + 2, SIDES + 1)]
BODIES["dense"] = shape(
    "Mesh",
    f"point3f[] points = {GRID}\n    int[] faceVertexCounts = {[4] * SIDES**2}\n    int[] faceVertexIndices = {FACES}\n"
    '    uniform token subdivisionScheme = "none"',
)


def reported(text: str) -> list[str]:
    return [d.message for d in translate(stage_of(text), RenderSettings(resolution=(64, 48)))[1] if d.code == "near-plane"]


@pytest.mark.parametrize("name", BODIES)
def test_what_is_cut_open_is_named(name: str) -> None:
    (message,) = reported(CAMERA % 4.5 + BODIES[name])
    assert "/body" in message
    distance = float(message.split("nearest at ")[1].split(":")[0])
    assert distance == pytest.approx(5 - 2**0.5 if name == "turned" else 4, rel=0.02)
    assert reported(CAMERA % (0.99 * distance) + BODIES[name]) == []


@pytest.mark.parametrize(
    "text",
    [
        CAMERA % 1
        + shape("Cube", 'double3 xformOp:translate = (0, 0, 9)\n uniform token[] xformOpOrder = ["xformOp:translate"]'),
        CAMERA % 1
        + shape("Cube", 'double3 xformOp:translate = (0, 3, 5)\n uniform token[] xformOpOrder = ["xformOp:translate"]'),
        BODIES["cube"],
    ],
)
def test_what_is_behind_beside_or_seen_by_the_automatic_camera_is_not(text: str) -> None:
    assert reported(text) == []


MOVING = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 1: (1, 0, 0) }\n"
MOVING += "    uniform token[] xformOpOrder = ['xformOp:translate']"


@pytest.mark.parametrize(
    ("more", "settings", "is_reported"),
    [
        (MOVING, {}, True),
        (MOVING, {"shutter": (0.5, 0.5)}, True),
        (MOVING, {"shutter": (-0.25, 0.25)}, False),
        (MOVING, {"shutter": (-0.25, 0.25), "motion_blur": False}, False),
        (MOVING, {"aovs": ("depth",)}, False),
        ("", {}, False),
    ],
)
def test_motion_vectors_of_a_closed_shutter(more: str, settings: dict[str, object], is_reported: bool) -> None:
    stage = stage_of(CAMERA % 1 + shape("Sphere", more.replace("'", '"')))
    asked = RenderSettings(**{"aovs": ("motion_forward",), "time_code": 0.5, **settings})  # type: ignore[arg-type]
    said = [d.message for d in translate(stage, asked)[1] if d.code == "vectors-still"]
    assert bool(said) is is_reported
    assert all("--shutter" in message for message in said)
