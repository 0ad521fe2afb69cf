"""Points over the shutter, against UsdGeomPointBased::ComputePointsAtTimes of the frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from primray.description import Mesh, PointMotion, SceneDescription, SubdivisionMesh
from primray.settings import RenderSettings
from primray.usd import translate

from ..usd_text import stage_of
from .reference import points_at, world_at

FRAME = 2.0
CAMERA = 'def Camera "cam"\n{\ndouble shutter:open = -0.5\ndouble shutter:close = 0.5\n}\n'
Rows = list[tuple[float, ...]]
QUAD: Rows = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
FACES = "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]\n"


def vectors(rows: Rows) -> str:
    return "[" + ", ".join(f"({', '.join(map(str, row))})" for row in rows) + "]"


def samples(attribute: str, values: Mapping[float, Rows]) -> str:
    inside = ", ".join(f"{time}: {vectors(rows)}" for time, rows in values.items())
    return f"{attribute}.timeSamples = {{ {inside} }}\n"


def shifted(z: float, count: int = 4) -> Rows:
    return [(x, y, z) for x, y, _ in (QUAD * 2)[:count]]


def same(*vector: float, count: int = 4) -> Rows:
    return [tuple(vector)] * count


POINTS = samples("point3f[] points", {1: QUAD, 3: shifted(1)})
CASES = {
    "samples": POINTS,
    "many samples": samples("point3f[] points", {1: QUAD, 1.7: shifted(1), 1.9: shifted(-1), 2.25: shifted(0.5), 4: QUAD}),
    "velocities": POINTS + samples("vector3f[] velocities", {1: same(0, 24, 0), 3: same(0, 24, 0)}),
    "past other samples": samples("point3f[] points", {1.75: QUAD, 2.25: shifted(5), 3: shifted(1)})
    + samples("vector3f[] velocities", {1.75: same(0, 24, 0), 2.25: same(9, 9, 9), 3: same(0, 24, 0)}),
    "beyond the last sample": samples("point3f[] points", {0: QUAD, 1: shifted(1)})
    + samples("vector3f[] velocities", {0: same(0, 24, 0), 1: same(0, 48, 0)}),
    "before the first sample": samples("point3f[] points", {3: QUAD}) + samples("vector3f[] velocities", {3: same(0, 24, 0)}),
    "accelerations": POINTS
    + samples("vector3f[] velocities", {1: same(0, 24, 0), 3: same(0, 24, 0)})
    + samples("vector3f[] accelerations", {1: same(0, 0, 576), 3: same(0, 0, 576)}),
    "misaligned accelerations": POINTS
    + samples("vector3f[] velocities", {1: same(0, 24, 0), 3: same(0, 24, 0)})
    + samples("vector3f[] accelerations", {1: same(0, 0, 576), 2: same(0, 0, 576)}),
    "misaligned velocities": POINTS + samples("vector3f[] velocities", {1: same(0, 24, 0), 2.5: same(0, 24, 0)}),
    "velocities of no time": POINTS + f"vector3f[] velocities = {vectors(same(0, 24, 0))}\n",
    "too few velocities": POINTS + samples("vector3f[] velocities", {1: same(0, 24, 0, count=2), 3: same(0, 24, 0)}),
    "another topology, with velocities": samples("point3f[] points", {1: QUAD, 2.25: shifted(1, 8)})
    + samples("vector3f[] velocities", {1: same(0, 24, 0), 2.25: same(0, 24, 0, count=8)}),
    "another topology": samples("point3f[] points", {1: QUAD, 2.25: shifted(1, 8)}),
}
TOLD = {
    "misaligned accelerations": "accelerations",
    "misaligned velocities": "velocities",
    "velocities of no time": "velocities",
    "too few velocities": "velocities",
    "another topology": "points",
}


def translated(body: str, kind: str = "Mesh", **settings: Any) -> tuple[SceneDescription, Usd.Stage, list[str]]:
    stage = stage_of(f'{CAMERA}def {kind} "m"\n{{\n{FACES}{body}}}\n')
    chosen: dict[str, Any] = {"time_code": FRAME, "resolution": (64, 36), "camera": "/cam", **settings}
    d, diagnostics = translate(stage, RenderSettings(**chosen))
    return d, stage, [x.attribute for x in diagnostics if x.code == "motion"]


def oracle(stage: Usd.Stage, times: list[float]) -> np.ndarray:
    return np.array([np.array(p) for p in UsdGeom.PointBased(stage.GetPrimAtPath("/m")).ComputePointsAtTimes(times, FRAME)])


def motion_of(d: SceneDescription) -> PointMotion | None:
    (shape,) = d.shapes
    assert isinstance(shape, Mesh | SubdivisionMesh)
    return shape.motion


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
@pytest.mark.parametrize("name", CASES)
def test_points_are_usds(name: str, scheme: str) -> None:
    d, stage, told = translated(CASES[name] + f'uniform token subdivisionScheme = "{scheme}"\n')
    motion = motion_of(d)
    fractions = np.linspace(0, 1, 41)
    true = oracle(stage, [FRAME - 0.5 + f for f in fractions])
    (shape,) = d.shapes
    assert isinstance(shape, Mesh | SubdivisionMesh)
    found = np.array([shape.points if motion is None else points_at(motion, float(f)) for f in fractions])
    assert np.abs(found - true).max() < (1e-3 if name == "accelerations" else 1e-6)
    assert np.abs(shape.points - oracle(stage, [FRAME])[0]).max() < 1e-6
    assert told == ([TOLD[name]] if name in TOLD else [])
    assert (d.exposure is None) == (motion is None)


@pytest.mark.parametrize("name", [name for name in CASES if name != "another topology"])
def test_spheres_go_where_points_go(name: str) -> None:
    d, stage, _ = translated(CASES[name], "Points")
    for fraction in (0.0, 0.3, 0.5, 0.77, 1.0):
        true = oracle(stage, [FRAME - 0.5 + fraction])[0]
        found = np.array([matrix[:3, 3] for matrix in world_at(d, "/m", fraction)])
        assert np.abs(found - true).max() < (5e-3 if name == "accelerations" else 1e-5)


def test_widths_change_with_their_samples() -> None:
    widths = "float[] widths.timeSamples = { 1: [1, 1, 1, 1], 3: [3, 1, 1, 2] }\n"
    d, _, _ = translated(f"point3f[] points = {vectors(QUAD)}\n{widths}", "Points")
    assert [m[0, 0] for m in world_at(d, "/m", 0.0)] == [0.75, 0.5, 0.5, 0.625]
    assert [m[0, 0] for m in world_at(d, "/m", 1.0)] == [1.25, 0.5, 0.5, 0.875]


def test_velocities_are_two_samples_on_a_line() -> None:
    by_samples, _, _ = translated(samples("point3f[] points", {1: shifted(-1), 3: shifted(1)}))
    by_velocities, _, _ = translated(
        samples("point3f[] points", {2: QUAD}) + samples("vector3f[] velocities", {2: same(0, 0, 24)})
    )
    a, b = motion_of(by_samples), motion_of(by_velocities)
    assert a is not None
    assert b is not None
    assert a.times.tolist() == b.times.tolist() == [0, 1]
    assert (a.points == b.points).all()


def test_houdinis_velocities_count() -> None:
    body = POINTS + samples("vector3f[] velocities", {1: same(0, 24, 0), 3: same(0, 24, 0)})
    usual, _, _ = translated(body)
    houdinis, _, told = translated(body.replace("velocities.", "primvars:velocities."))
    a, b = motion_of(usual), motion_of(houdinis)
    assert a is not None
    assert b is not None
    assert (a.points == b.points).all()
    assert told == []


def test_an_extra_sample_on_the_line_changes_no_bit() -> None:
    plain, _, _ = translated(samples("point3f[] points", {1: QUAD, 3: shifted(2)}))
    more, _, _ = translated(samples("point3f[] points", {1: QUAD, 2.25: shifted(1.25), 3: shifted(2)}))
    a, b = motion_of(plain), motion_of(more)
    assert a is not None
    assert b is not None
    assert (a.times.tolist(), a.points.tolist()) == (b.times.tolist(), b.points.tolist())


def test_half_the_blur_is_half_the_shutter() -> None:
    half, _, _ = translated(
        CASES["many samples"].replace("point3f", "float motion:blurScale = 0.5\npoint3f", 1), shutter=(0, 1)
    )
    api = f'def Mesh "m" (apiSchemas = ["MotionAPI"])\n{{\nfloat motion:blurScale = 0.5\n{FACES}{CASES["many samples"]}}}\n'
    settings = RenderSettings(time_code=FRAME, shutter=(0, 1), camera="/cam")
    half = translate(stage_of(CAMERA + api), settings)[0]
    short, _, _ = translated(CASES["many samples"], shutter=(0, 0.5))
    a, b = motion_of(half), motion_of(short)
    assert a is not None
    assert b is not None
    assert (a.times.tolist(), a.points.tolist()) == (b.times.tolist(), b.points.tolist())


@pytest.mark.parametrize("instant", [-0.5, 0.3])
def test_a_still_is_of_its_instant(instant: float) -> None:
    for name in ("many samples", "velocities"):
        d, stage, _ = translated(CASES[name], shutter=(instant, instant))
        assert d.exposure is None
        (shape,) = d.shapes
        assert isinstance(shape, Mesh | SubdivisionMesh)
        assert np.abs(shape.points - oracle(stage, [FRAME + instant])[0]).max() < 1e-6


def test_normals_turn_with_the_points() -> None:
    normals = samples("normal3f[] normals", {1: same(0, 0, 1), 3: same(0, 1, 0)})
    plain = 'uniform token subdivisionScheme = "none"\n'
    d, _, _ = translated(POINTS + normals + plain)
    motion = motion_of(d)
    assert motion is not None
    assert motion.normals is not None
    assert np.allclose(motion.normals[0][0], np.array([0, 1, 3]) / np.sqrt(10))
    held, _, _ = translated(POINTS + f"normal3f[] normals = {vectors(same(0, 0, 1))}\n" + plain)
    motion = motion_of(held)
    assert motion is not None
    assert motion.normals is None


def test_points_that_become_corners_take_their_motion_along() -> None:
    """Three triangles of nine points: whose normals could be either's, so they move to the corners."""
    points: Rows = [(float(k), float(k % 3 == 1), 0.0) for k in range(9)]
    moved: Rows = [(x, y, 1.0) for x, y, _ in points]
    body = samples("point3f[] points", {1: points, 3: moved}) + 'uniform token subdivisionScheme = "none"\n'
    faces = "int[] faceVertexCounts = [3, 3, 3]\nint[] faceVertexIndices = [2, 1, 0, 5, 4, 3, 8, 7, 6]\n"
    normals = f"normal3f[] normals = {vectors(same(0, 0, 1, count=9))}\n"
    stage = stage_of(f'{CAMERA}def Mesh "m"\n{{\n{faces}{body}{normals}}}\n')
    d, _ = translate(stage, RenderSettings(time_code=FRAME, camera="/cam"))
    (shape,) = d.shapes
    assert isinstance(shape, Mesh)
    assert shape.motion is not None
    assert (shape.motion.points[..., :2] == shape.points[:, :2]).all()


FALLING = samples("point3f[] points", {1: QUAD, 3: QUAD}) + "".join(
    samples(f"vector3f[] {name}", {1: same(0, value, 0), 3: same(0, value, 0)})
    for name, value in (("velocities", 48.0), ("accelerations", 1152.0))
)


def falling(z: float, more: str = "", **settings: Any) -> tuple[SceneDescription, Mesh, list[str]]:
    """Seen from this far away."""
    placed = f'double3 xformOp:translate = (0, 0, {-z})\nuniform token[] xformOpOrder = ["xformOp:translate"]\n'
    d, _, told = translated('uniform token subdivisionScheme = "none"\n' + FALLING + placed + more, **settings)
    (shape,) = d.shapes
    assert isinstance(shape, Mesh)
    return d, shape, told


@pytest.mark.parametrize("z", [3.0, 30.0, 3000.0])
def test_what_accelerates_is_as_exact_as_pixels_ask(z: float) -> None:
    d, shape, told = falling(z, motion_error=0.02)
    assert shape.motion is not None
    assert not told
    off = 0.0
    for fraction in np.linspace(0, 1, 101):
        t = (1.0 - 0.5 + fraction) / 24
        true = np.array(QUAD) + t * (np.array([0, 48, 0]) + 0.5 * t * np.array([0, 1152, 0])) - (0, 0, z)
        found = points_at(shape.motion, float(fraction)) - (0, 0, z)
        off = max(
            off, float(np.linalg.norm(d.camera.project(found, (64, 36)) - d.camera.project(true, (64, 36)), axis=1).max())
        )
    assert off < 0.02 + 1e-3


def test_what_is_far_away_needs_few_times() -> None:
    counts = [len(shape.motion.times) for z in (3.0, 30.0, 3000.0) if (shape := falling(z)[1]).motion is not None]
    assert counts[0] > counts[1] > counts[2] == 2


def test_an_instance_that_is_near_counts() -> None:
    """The other stands far away."""
    meshes = f'def Mesh "m"\n{{\n{FACES}uniform token subdivisionScheme = "none"\n{FALLING}}}\n'
    instances = [
        f'def Xform "i{z}" (\ninstanceable = true\nprepend references = </kind>\n)\n{{\n'
        f'double3 xformOp:translate = (0, 0, -{z})\nuniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
        for z in (3, 3000)
    ]
    stage = stage_of(f'{CAMERA}class "kind"\n{{\n{meshes}}}\n' + "".join(instances))
    d, _ = translate(stage, RenderSettings(time_code=FRAME, resolution=(64, 36), camera="/cam"))
    (shape,) = d.shapes
    (near,) = (falling(3.0)[1].motion,)
    assert isinstance(shape, Mesh)
    assert shape.motion is not None
    assert near is not None
    assert len(shape.motion.times) == len(near.times)


def test_what_is_left_of_an_error_is_told() -> None:
    _, shape, told = falling(3.0, motion_error=1e-4, resolution=(4096, 2304))
    assert shape.motion is not None
    assert len(shape.motion.times) == 129
    assert told == [""]
