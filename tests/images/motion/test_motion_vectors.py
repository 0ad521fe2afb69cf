"""Motion vectors: pixels from where a point is seen at the frame to where it is as the shutter opens and closes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd

import primray
from primray.lens.distortion import DirectionTable, Distortion, DistortionModel

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


LENSES = {
    "rational": Distortion(DistortionModel.RATIONAL, (-0.2, 0.05, 0.002, -0.003, 0.0, 0.01, *[0.001] * 6), 90.0),
    "fisheye": Distortion(DistortionModel.ANGLE_TO_RADIUS, (1.0, 0.03, -0.01, 0.002, 0.0003)),
    "f-theta": Distortion(DistortionModel.RADIUS_TO_ANGLE, (0.0, 1.0, -0.02, 0.03, 0.001), 100.0),
}


def as_table(lens: Distortion, half: float = 1.5, size: int = 33) -> Distortion:
    """Directions at the texels of a film, which it bends between them."""
    at = ((np.arange(size) + 0.5) / size * 2 - 1) * half
    x, y = np.meshgrid(at, -at)
    radius = np.hypot(x, y)
    angle = np.polynomial.polynomial.polyval(radius, lens.coefficients)
    across = np.where(radius > 0, np.sin(angle) / np.maximum(radius, 1e-9), 0.0)
    directions = np.stack([x * across, y * across, -np.cos(angle)], axis=-1).astype(np.float32)
    return Distortion(DistortionModel.TABLE, (), 100.0, DirectionTable((-half, half, -half, half), directions))


@pytest.mark.parametrize("name", [*LENSES, "table"])
def test_vectors_go_through_the_lens(name: str) -> None:
    """As the camera projects what is seen, and where that is then; a ball may leave what the lens sees."""
    lens = LENSES[name] if name in LENSES else as_table(LENSES["f-theta"])
    eye = np.eye(4)
    eye[:3, 3] = 0, 0, 3
    camera = primray.Camera("", eye, primray.Projection.PERSPECTIVE, (-0.8, 0.8, -0.6, 0.6), (0.01, 100.0), distortion=lens)
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(HEAD % STILL + PANE % (POINTS + MOVED))
    stage.GetRootLayer().timeCodesPerSecond = 24
    image = primray.render(
        stage, camera=camera, shutter=(-0.25, 0.5), resolution=(80, 60), spp=2, time_code=2.0, aovs=(*AOVS, "position")
    )
    seen = image.aovs["prim"].values[..., 0] > 0
    at = image.aovs["position"].values[seen].astype(np.float64)
    assert seen.sum() > 300
    for vector, time in (("motion_forward", 0.5), ("motion_backward", -0.25)):
        moved = camera.project(at + time * np.array([1.0, 0.5, 0.0]), (80, 60)) - camera.project(at, (80, 60))
        assert np.isfinite(moved).all()
        assert np.ptp(moved[:, 0]) > 0.2  # a lens bends them
        np.testing.assert_allclose(image.aovs[vector].values[seen], moved, atol=1e-3)
