"""Every attribute of UsdGeomPointInstancer: authored, the instances stand as the schema says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pxr import UsdGeom

from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of, translate_text


def conforms(row: str, *values: Any, state: str = "honoured") -> Any:
    return pytest.param(*values, marks=pytest.mark.conforms(row, state=state), id=row)


def about_x(degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


INSTANCER = """def PointInstancer "p"
{
    rel prototypes = [</p/a>, </p/b>]
    int[] protoIndices = [0, 1, 1]
    point3f[] positions = [(0, 0, 0), (10, 0, 0), (20, 0, 0)]
    %s
    def Sphere "a"
    {
        double radius = 1
    }
    def Sphere "b"
    {
        double radius = 2
    }
}
"""


def stands(more: str, meta: str = "", prototypes: str = "[</p/a>, </p/b>]") -> dict[float, tuple[float, np.ndarray]]:
    """x -> radius, and the matrix."""
    text = (INSTANCER % more).replace("[</p/a>, </p/b>]", prototypes)
    text = text.replace('"p"\n{', f'"p" ({meta})\n{{' if meta else '"p"\n{', 1)
    description, _ = translate_text(text)
    found = {}
    for placed in description.static:
        found[float(placed.matrix[0, 3])] = (description.shapes[placed.shape].radius, placed.matrix[:3, :3])  # type: ignore[union-attr]
    for placement in description.placements:
        for m in np.concatenate(list(placement.chunks())):
            (inner,) = description.prototypes[placement.prototype].shapes
            found[float(m[0, 3])] = (description.shapes[inner.shape].radius, m[:3, :3])  # type: ignore[union-attr]
    return found


@pytest.mark.conforms("PointInstancer.prototypes", "PointInstancer.protoIndices", "PointInstancer.positions")
def test_instances_stand_where_they_are_put() -> None:
    assert {x: radius for x, (radius, _) in stands("").items()} == {0: 1, 10: 2, 20: 2}
    swapped = stands("", prototypes="[</p/b>, </p/a>]")
    assert {x: radius for x, (radius, _) in swapped.items()} == {0: 2, 10: 1, 20: 1}


TURNED = "[(0.6, 0.8, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)]"


@pytest.mark.parametrize(
    ("authored", "expected"),
    [
        conforms("PointInstancer.scales", "float3[] scales = [(1, 2, 3), (1, 1, 1), (1, 1, 1)]", np.diag([1, 2, 3])),
        conforms("PointInstancer.orientations", f"quath[] orientations = {TURNED}", about_x(106.2602047)),
        conforms("PointInstancer.orientationsf", f"quatf[] orientationsf = {TURNED}", about_x(106.2602047)),
    ],
)
def test_instances_are_turned_and_scaled(authored: str, expected: np.ndarray) -> None:
    assert stands(authored)[0.0][1] == pytest.approx(expected, abs=1e-3 if "quath" in authored else 1e-6)


@pytest.mark.parametrize(
    ("authored", "meta", "left"),
    [
        conforms("PointInstancer.invisibleIds", "int64[] invisibleIds = [1]", "", {0, 20}),
        conforms("PointInstancer.ids", "int64[] ids = [7, 8, 9]\nint64[] invisibleIds = [7, 1]", "", {10, 20}),
        conforms("PointInstancer.invisibleIds", "int64[] invisibleIds.timeSamples = { 3: [1], 5: [] }", "", {0, 20}),
        conforms("PointInstancer.ids", "int64[] ids.timeSamples = { 3: [7, 8, 9] }\nint64[] invisibleIds = [7]", "", {10, 20}),
        conforms("PointInstancer.inactiveIds", "", "inactiveIds = [2]", {0, 10}),
        conforms("PointInstancer.inactiveIds", "int64[] ids.timeSamples = { 3: [7, 8, 9] }", "inactiveIds = [7]", {10, 20}),
    ],
)
def test_instances_are_hidden_by_their_ids(authored: str, meta: str, left: set[float]) -> None:
    """Also where they have time samples alone, of which a still is the earliest, as for all else."""
    assert set(stands(authored, meta)) == left


@pytest.mark.parametrize("authored", ["int64[] invisibleIds = [1]\nint64[] ids = [1, 2]", "string[] invisibleIds = ['1']"])
def test_ids_of_no_use_hide_nothing_and_are_told(authored: str) -> None:
    code = "wrong-type" if "string" in authored else "invalid-instancer"
    assert set(stands(authored)) == {0, 10, 20}
    assert (code, "/p") in translate_text(INSTANCER % authored)[1]


SPEED = "[(0, 0, 24), (0, 0, 24), (0, 24, 24)]"
SPIN = "[(0, 0, 240), (2400, 0, 0), (100, -1000, 240)]"
FAST = "[(0, 576, 0), (576, 0, 0), (0, 0, 0)]"
STILL = "[(1, 0, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)]"


def sampled(name: str, values: str) -> str:
    return f"vector3f[] {name}.timeSamples = {{ 1: {values}, 3: {values} }}\n"


@pytest.mark.parametrize(
    "authored",
    [
        conforms("PointInstancer.velocities", sampled("velocities", SPEED)),
        conforms("PointInstancer.accelerations", sampled("velocities", SPEED) + sampled("accelerations", FAST)),
        conforms("PointInstancer.angularVelocities", sampled("angularVelocities", SPIN)),
        pytest.param(sampled("velocities", SPEED) + sampled("angularVelocities", SPIN), id="both"),
        pytest.param(f"vector3f[] velocities = {SPEED}", id="of no time"),
    ],
)
@pytest.mark.parametrize("time", [1.0, 1.75, 2.0, 3.0, 3.5])
def test_velocities_move_instances_between_samples(authored: str, time: float) -> None:
    moving = (
        "point3f[] positions.timeSamples = { 1: [(0, 0, 0), (10, 0, 0), (20, 0, 0)], 3: [(0, 0, 1), (10, 0, 1), (20, 0, 1)] }"
    )
    turning = f"quatf[] orientationsf.timeSamples = {{ 1: {STILL}, 3: {STILL} }}"
    scaling = "float3[] scales.timeSamples = { 1: [(1, 1, 1), (1, 1, 1), (1, 1, 1)], 3: [(3, 1, 1), (2, 2, 2), (1, 1, 1)] }"
    stage = stage_of(
        (INSTANCER % f"{moving}\n{turning}\n{scaling}\n{authored}").replace(
            "    point3f[] positions = [(0, 0, 0), (10, 0, 0), (20, 0, 0)]\n", ""
        )
    )
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/p"))
    oracle = np.array(instancer.ComputeInstanceTransformsAtTime(time, time)).transpose(0, 2, 1)
    d = translate(stage, RenderSettings(time_code=time))[0]
    of_b = next(p for p in d.placements if len(p) == 2).levels[0].rows(0, 2)
    found = np.concatenate([d.static[0].matrix[None, :3], of_b])
    assert np.allclose(found, oracle[:, :3], atol=1e-6)
