"""Motion vectors: pixels from where a point is seen at the frame to where it is as the shutter opens and closes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray

HEAD = """#usda 1.0
( timeCodesPerSecond = 24 )
def Camera "c"
{
    token projection = "orthographic"
    float horizontalAperture = 80
    float verticalAperture = 60
    double shutter:open = -0.25
    double shutter:close = 0.5
    %s
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
STILL = "double3 xformOp:translate = (0, 0, 10)"
PANE = """
def Mesh "pane"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    %s
}
"""
POINTS = "point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]"
MOVED = """
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 3: (2, 1, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
DEFORMED = """point3f[] points.timeSamples = {
        1: [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)],
        3: [(1, 0, 0), (3, 0, 0), (3, 2, 0), (1, 2, 0)] }"""
AOVS = ("motion_forward", "motion_backward", "prim")


def vectors(text: str, **more: Any) -> dict[str, np.ndarray]:
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(text)
    image = primray.render(stage, resolution=(80, 60), spp=2, time_code=2.0, aovs=AOVS, **more)
    return {name: image.aovs[name].values.astype(np.float64) for name in AOVS}


@pytest.mark.parametrize("blur", [True, False])
@pytest.mark.parametrize(
    "text",
    [
        HEAD % STILL + PANE % (POINTS + MOVED),
        HEAD % STILL + PANE % DEFORMED,
        HEAD % "double3 xformOp:translate.timeSamples = { 1: (0, 0, 10), 3: (-2, -1, 10) }" + PANE % POINTS,
    ],
    ids=["instance", "points", "camera"],
)
def test_what_moves(text: str, blur: bool) -> None:
    """1 unit right and half a unit up a frame: 10 pixels and -5."""
    found = vectors(text, motion_blur=blur)
    seen = found["prim"][..., 0] > 0
    assert 300 < seen.sum() < 500
    np.testing.assert_allclose(found["motion_forward"][seen], [[5.0, -2.5]] * seen.sum(), atol=2e-3)
    np.testing.assert_allclose(found["motion_backward"][seen], [[-2.5, 1.25]] * seen.sum(), atol=2e-3)
    assert not found["motion_forward"][~seen].any()


def test_what_stands_still() -> None:
    """Exactly 0, also beside what moves; and without a shutter."""
    other = PANE.replace("pane", "other") % POINTS.replace("(-1", "(-4").replace("(1", "(-2")
    found = vectors(HEAD % STILL + PANE % (POINTS + MOVED) + other)
    left = np.zeros((60, 80), bool)
    left[:, :25] = True
    assert (found["prim"][left] > 0).any()
    assert not found["motion_forward"][left].any()
    closed = (HEAD % STILL).replace("close = 0.5", "close = -0.25") + PANE % (POINTS + MOVED)
    assert not vectors(closed)["motion_forward"].any()


def test_aovs_show_the_frame_whatever_the_shutter() -> None:
    late = (HEAD % STILL).replace("open = -0.25", "open = 0.25") + PANE % (POINTS + MOVED)
    still = (HEAD % STILL).replace("open = -0.25", "open = 0").replace("close = 0.5", "close = 0") + PANE % (POINTS + MOVED)
    np.testing.assert_array_equal(vectors(late)["prim"], vectors(still)["prim"])
    seen = vectors(late)["prim"][..., 0] > 0
    assert not vectors(late)["motion_backward"][seen].any()
