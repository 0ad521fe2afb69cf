"""Implicit shapes whose sizes change while the shutter is open, against the shapes that have these sizes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from primray.description import Mesh, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.shapes import tessellate

from ..motion.reference import points_at
from ..usd_text import stage_of

FRAME = 5.0
CAMERA = """def Camera "cam"
{
    double shutter:open = OPEN
    double shutter:close = CLOSE
    double3 xformOp:translate = (0, 0, 12)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
GROWING = "{ 4: 1, 5.25: 2, 6: 0.5 }"
SPLINED = "double size.spline = { 4: 1; post curve (0.5, 0.4), 6: 3 }"
SHAPES = {
    "Cube": f"double size.timeSamples = {GROWING}",
    "Plane": f"double width.timeSamples = {GROWING}",
    "Cone": f"double height.timeSamples = {GROWING}\ndouble radius.timeSamples = {GROWING}",
    "Cylinder": f"double radius.timeSamples = {GROWING}\n" + 'uniform token axis = "X"',
    "Capsule": f"double height.timeSamples = {GROWING}\ndouble radius = 0.25",
    "Capsule_1": f"double radiusTop.timeSamples = {GROWING}\ndouble radiusBottom = 0.25\ndouble height = 4",
    "Cylinder_1": "double radiusTop.timeSamples = { 4: 0, 5.25: 2, 6: 0.5 }\ndouble radiusBottom = 0.25",
}


def translated(
    kind: str, sizes: str, opens: float = -0.5, closes: float = 0.5, **settings: Any
) -> tuple[SceneDescription, Any]:
    text = CAMERA.replace("OPEN", str(opens)).replace("CLOSE", str(closes)) + f'def {kind} "s"\n{{\n{sizes}\n}}\n'
    chosen: dict[str, Any] = {"time_code": FRAME, "resolution": (640, 360), "camera": "/cam", **settings}
    d, diagnostics = translate(stage_of(text), RenderSettings(**chosen))
    return d, [x.message for x in diagnostics if x.code == "motion"]


def mesh_of(d: SceneDescription) -> Mesh:
    (shape,) = d.shapes
    assert isinstance(shape, Mesh)
    return shape


def expected_points(kind: str, time: float) -> np.ndarray:
    """(N, 3) as a still has them then; the caps of unequal capsules keep the rings that they have at the frame."""
    if kind != "Capsule_1":
        return mesh_of(translated(kind, SHAPES[kind], 0, 0, time_code=time)[0]).points
    then, frame = (float(np.interp(t, [4, 5.25, 6], [1, 2, 0.5])) for t in (time, FRAME))
    return tessellate.capsule(0.25, then, 4.0, "Z", *tessellate.cap_rings(0.25, frame, 4.0)).points


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("error", [0.5, 0.02])
def test_sizes_are_followed(kind: str, error: float) -> None:
    d, told = translated(kind, SHAPES[kind], motion_error=error)
    assert not told
    motion = mesh_of(d).motion
    assert motion is not None
    for fraction in np.linspace(0, 1, 23):
        expected = expected_points(kind, FRAME - 0.5 + fraction)
        found, true = (d.camera.project(p.astype(float), (640, 360)) for p in (points_at(motion, fraction), expected))
        assert np.linalg.norm(found - true, axis=1).max() < error + 2e-3


def test_a_spline_is_followed() -> None:
    d, told = translated("Cube", SPLINED, motion_error=0.02)
    assert not told
    motion = mesh_of(d).motion
    assert motion is not None
    assert len(motion.times) > 2
    for fraction in np.linspace(0, 1, 23):
        still, _ = translated("Cube", SPLINED, 0, 0, time_code=FRAME - 0.5 + fraction)
        found, true = (
            d.camera.project(p.astype(float), (640, 360)) for p in (points_at(motion, fraction), mesh_of(still).points)
        )
        assert np.linalg.norm(found - true, axis=1).max() < 0.022


@pytest.mark.parametrize("kind", SHAPES)
def test_a_still_has_the_size_of_its_instant(kind: str) -> None:
    found, expected = (
        translated(kind, SHAPES[kind], 0.25, 0.25)[0],
        translated(kind, SHAPES[kind], 0, 0, time_code=FRAME + 0.25)[0],
    )
    assert found.exposure is None
    np.testing.assert_allclose(mesh_of(found).points, mesh_of(expected).points, atol=1e-6)


def test_normals_lean_with_the_surface() -> None:
    d, _ = translated("Cone", "double height.timeSamples = { 4: 1, 6: 3 }")
    motion = mesh_of(d).motion
    assert motion is not None
    assert motion.normals is not None
    end, _ = translated("Cone", "double height.timeSamples = { 4: 1, 6: 3 }", 0, 0, time_code=FRAME + 0.5)
    expected = mesh_of(end).normals
    assert expected is not None
    np.testing.assert_allclose(motion.normals[-1], expected, atol=1e-6)


def test_left_handed_shapes_stay_turned_round() -> None:
    sizes = SHAPES["Cone"] + '\nuniform token orientation = "leftHanded"'
    d, _ = translated("Cone", sizes)
    motion = mesh_of(d).motion
    assert motion is not None
    assert motion.normals is None or np.sum(motion.normals[0] * mesh_of(d).normals) > 0


def test_what_becomes_another_shape_is_told() -> None:
    d, told = translated(
        "Capsule_1", "double height.timeSamples = { 4: 0.1, 6: 3 }\ndouble radiusTop = 1\ndouble radiusBottom = 0.1"
    )
    assert mesh_of(d).motion is None
    assert "not blurred" in told[0]


def test_sizes_that_rest_cost_nothing() -> None:
    d, _ = translated("Cube", "double size.timeSamples = { 1: 1, 4: 2, 6: 2 }")
    assert d.exposure is None
    assert mesh_of(d).motion is None
