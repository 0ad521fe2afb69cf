"""Motion over the shutter of cameras, and of shapes and lights beside them."""

from __future__ import annotations

import pytest
from tests.unit.usd.camera.optics_text import (
    EYE,
    MOVING,
    OPS,
    SHUTTER,
    exposed,
    moved,
    stage_with,
)

from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of

STILL = "velocities.timeSamples = { 5: [(0, 0, 0), (0, 0, 0), (0, 0, 0)]"


RESTING = {
    "equal samples": moved("Sphere s", "double3 xformOp:translate", "(1, 0, 0)", "(1, 0, 0)", OPS),
    "moves later": MOVING["a transform"].replace("0: (0, 0, 0), 10:", "6: (0, 0, 0), 10:"),
    "has moved": MOVING["a transform"].replace("0: (0, 0, 0), 10:", "0: (0, 0, 0), 4:"),
    "invisible": moved(
        "Sphere s", "double3 xformOp:translate", "(0, 0, 0)", "(1, 0, 0)", OPS + '\ntoken visibility = "invisible"'
    ),
    "of another purpose": moved(
        "Sphere s", "double3 xformOp:translate", "(0, 0, 0)", "(1, 0, 0)", OPS + '\nuniform token purpose = "guide"'
    ),
    "a colour": moved("Sphere s", "color3f[] primvars:displayColor", "[(0, 0, 0)]", "[(1, 0, 0)]"),
    "no velocity": MOVING["velocities"].replace("velocities.timeSamples = { 5: [(0, 0, 0), (1, 0, 0), (0, 1, 0)]", STILL),
}  # fmt: skip


@pytest.mark.conforms("Camera.shutter:open", "Camera.shutter:close")
@pytest.mark.parametrize("name", MOVING)
def test_what_moves_is_exposed(name: str) -> None:
    found = exposed(MOVING[name]).exposure
    assert found is not None
    assert (found.opens, found.closes, found.span) == (-0.25, 0.25, (-0.25, 0.25))
    stage = stage_of((EYE + MOVING[name]).replace(SHUTTER, ""))
    assert translate(stage, RenderSettings(camera="/rig/eye", time_code=5.0))[0].exposure is None


@pytest.mark.parametrize("name", RESTING)
def test_what_rests_is_not(name: str) -> None:
    assert exposed(RESTING[name]).exposure is None


def test_a_light_keeps_its_size() -> None:
    growing = moved("SphereLight s", "float inputs:radius", "1", "2")
    found, diagnostics = translate(stage_with(growing), RenderSettings(camera="/rig/eye", time_code=5.0))
    assert found.exposure is None
    told = [d for d in diagnostics if d.code == "motion"]
    assert [(d.prim_path, d.attribute) for d in told] == [("/s", "inputs:radius")]


def test_at_the_default_time_the_earliest_samples_stand_for_the_frame() -> None:
    assert exposed(MOVING["a transform"], None).exposure is not None
    assert exposed(RESTING["equal samples"], None).exposure is None


def test_the_camera_moves_and_others_do_not_matter() -> None:
    eye = EYE.replace(SHUTTER, SHUTTER + "float focalLength.timeSamples = { 0: 50, 10: 60 }")
    found = translate(stage_of(eye), RenderSettings(camera="/rig/eye", time_code=5.0))[0]
    assert found.camera_motion is not None
    assert exposed("").exposure is None
