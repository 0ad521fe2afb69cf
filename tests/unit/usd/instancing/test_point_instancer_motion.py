"""Point instancers over the shutter, against UsdGeomPointInstancer::ComputeInstanceTransformsAtTimes of the frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from primray.description import SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

from ..motion.reference import world_at
from ..usd_text import stage_of

FRAME = 2.0
CAMERA = """def Camera "cam"
{
    double shutter:open = -0.5
    double shutter:close = 0.5
    double3 xformOp:translate = (0, 0, 40)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
TEXT = """def PointInstancer "i"
{
    rel prototypes = [</i/a>, </i/b>]
    int[] protoIndices = [0, 1, 0]
    %s
    def Cube "a"
    {
    }
    def Cube "b"
    {
    }
}
"""
POSITIONS = (
    "point3f[] positions.timeSamples = { 1: [(0, 0, 0), (5, 0, 0), (10, 0, 0)], 3: [(0, 2, 0), (5, 0, 3), (10, 0, 0)] }\n"
)
TURNS = """quatf[] orientationsf.timeSamples = {
    1: [(1, 0, 0, 0), (0.7071067, 0, 0.7071067, 0), (0.7071067, 0, 0.7071067, 0)],
    3: [(0, 0, 0, 1), (0.5, 0.5, 0.5, 0.5), (0.7071067, 0, -0.7071067, 0)] }
"""
SCALES = "float3[] scales.timeSamples = { 1: [(1, 1, 1), (1, 1, 1), (1, 1, 1)], 3: [(2, 2, 2), (1, 3, 1), (1, 1, 1)] }\n"
SPEED = "vector3f[] velocities.timeSamples = { 1: [(0, 24, 0), (24, 0, 0), (0, 0, 0)], 3: [(0, 0, 0), (0, 0, 0), (0, 0, 0)] }\n"
FASTER = SPEED.replace("velocities", "accelerations").replace("24", "576")
SPIN = SPEED.replace("velocities", "angularVelocities").replace("(0, 24, 0), (24, 0, 0)", "(0, 0, 2160), (2400, 100, 0)")
CASES = {
    "positions": POSITIONS,
    "all by samples": POSITIONS + TURNS + SCALES,
    "velocities": POSITIONS + TURNS + SCALES + SPEED,
    "accelerations": POSITIONS + SPEED + FASTER,
    "angular velocities alone": POSITIONS + TURNS + SCALES + SPIN,
    "both": POSITIONS + TURNS + SPEED + SPIN,
    "angular velocities without orientations": POSITIONS + SPIN,
    "misaligned velocities": POSITIONS + SPEED.replace("3:", "4:"),
    "at unequal times": POSITIONS.replace("3:", "1.75: [(1, 0, 0), (1, 0, 0), (1, 0, 0)], 2.4:"),
}
TOLD = {"misaligned velocities": ["velocities"], "angular velocities without orientations": ["angularVelocities"]}


def translated(body: str, camera: str = CAMERA, **settings: Any) -> tuple[SceneDescription, Usd.Stage, list[str]]:
    stage = stage_of(camera + TEXT % body)
    chosen: dict[str, Any] = {"time_code": FRAME, "resolution": (640, 360), "camera": "/cam", **settings}
    d, diagnostics = translate(stage, RenderSettings(**chosen))
    return d, stage, [x.attribute for x in diagnostics if x.code == "motion"]


def oracle(stage: Usd.Stage, time: float) -> np.ndarray:
    """(K, 4, 4)"""
    (found,) = UsdGeom.PointInstancer(stage.GetPrimAtPath("/i")).ComputeInstanceTransformsAtTimes([time], FRAME)
    return np.array(found).transpose(0, 2, 1)


CORNERS = np.array([[x, y, z, 1] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


@pytest.mark.parametrize("name", CASES)
def test_instances_are_where_usd_has_them(name: str) -> None:
    d, stage, told = translated(CASES[name])
    for fraction in np.linspace(0, 1, 31):
        true = oracle(stage, FRAME - 0.5 + float(fraction))
        found = np.array([*world_at(d, "/i/a", float(fraction)), *world_at(d, "/i/b", float(fraction))])[[0, 2, 1]]
        a, b = (np.einsum("kij,cj->kci", m, CORNERS)[..., :3].reshape(-1, 3) for m in (found, true))
        assert np.abs(d.camera.project(a, (640, 360)) - d.camera.project(b, (640, 360))).max() < 0.1
    assert told == TOLD.get(name, [])


def test_half_turns_are_halves_of_whole_ones() -> None:
    """Between half-precision quaternions the path does not bend at every step of theirs."""
    halves = TURNS.replace("quatf", "quath").replace("orientationsf", "orientations")
    d, _, _ = translated(POSITIONS + halves)
    assert max(len(level.times) for p in d.placements for level in p.levels) <= 3  # type: ignore[union-attr]


def test_masked_instances_stay_away() -> None:
    d, stage, _ = translated(CASES["all by samples"] + "int64[] invisibleIds = [0]\n")
    (found,) = world_at(d, "/i/a", 1.0)
    assert np.allclose(found[:3, 3], (10, 0, 0))
    assert len(oracle(stage, FRAME)) == 2


def test_instances_that_are_born_stay_away() -> None:
    more = "[(0, 9, 0), (5, 0, 9), (10, 0, 9), (20, 0, 0)]"
    born = POSITIONS.replace(" }", f", 2.25: {more} }}")
    d, _, told = translated(born)
    assert told == ["positions"]
    assert d.exposure is None
    speeds = "[(0, 24, 0), (24, 0, 0), (0, 0, 0)]"
    aligned = f"vector3f[] velocities.timeSamples = {{ 1: {speeds}, 2.25: {speeds[:-1]}, (0, 0, 0)], 3: {speeds} }}\n"
    d, stage, told = translated(born + aligned)
    assert told == []
    true = oracle(stage, 2.5)
    assert np.allclose([m[:3, 3] for m in world_at(d, "/i/a", 1.0)], true[[0, 2], :3, 3])


def test_the_instancer_itself_moves() -> None:
    turning = 'double xformOp:rotateZ.timeSamples = { 1: 0, 3: 180 }\nuniform token[] xformOpOrder = ["xformOp:rotateZ"]\n'
    d, stage, _ = translated(CASES["all by samples"] + turning)
    for fraction in np.linspace(0, 1, 21):
        time = FRAME - 0.5 + float(fraction)
        above = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(stage.GetPrimAtPath("/i"))).T
        true = above @ oracle(stage, time)
        found = np.array([*world_at(d, "/i/a", float(fraction)), *world_at(d, "/i/b", float(fraction))])[[0, 2, 1]]
        a, b = (np.einsum("kij,cj->kci", m, CORNERS)[..., :3].reshape(-1, 3) for m in (found, true))
        assert np.abs(d.camera.project(a, (640, 360)) - d.camera.project(b, (640, 360))).max() < 0.1


@pytest.mark.parametrize("instant", [-0.25, 0.75])
def test_a_still_is_of_its_instant(instant: float) -> None:
    for name in ("all by samples", "both", "accelerations"):
        d, stage, _ = translated(CASES[name], shutter=(instant, instant))
        assert d.exposure is None
        found = np.array([*world_at(d, "/i/a", 0.0), *world_at(d, "/i/b", 0.0)])[[0, 2, 1]]
        assert np.allclose(found, oracle(stage, FRAME + instant), atol=1e-5)
