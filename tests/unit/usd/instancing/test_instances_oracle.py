"""Every instance stands where USD's own functions put it: instance proxies, Gf's matrices, ComputeInstanceTransformsAtTime."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt
from tests.described import world_from_prototype
from tests.expanded import assert_same_triangles, flat_stage, world_triangles

from primray.description import SceneDescription, Sphere
from primray.settings import RenderSettings
from primray.usd import translate

ASSETS = Path(os.environ.get("PRIMRAY_ASSETS", Path(__file__).parents[5] / "shared" / "assets"))
STAGES = [
    *sorted(ASSETS.glob("pixar-imaging/*/*.usda")),
    ASSETS / "intent-vfx/scenes/simpleAssetScene.usd",
    ASSETS / "maya-usd/PointInstancer_Grid_7k.usda",
    ASSETS / "arnold-usd/test_1705/test.usda",
    ASSETS / "arnold-usd/test_2641/test.usda",
]


def check(stage: Usd.Stage, time_code: float | None, settings: RenderSettings | None = None) -> SceneDescription:
    """Translated, and expanded by USD and then translated: the same triangles in the world."""
    chosen = replace(settings or RenderSettings(), time_code=time_code)
    time = Usd.TimeCode.Default() if time_code is None else Usd.TimeCode(time_code)
    description, _ = translate(stage, chosen)
    flat, _ = translate(flat_stage(stage, time), RenderSettings())
    placed = [flat.shapes[inner.shape] for p in flat.placements for inner in flat.prototypes[p.prototype].shapes]
    assert all(isinstance(shape, Sphere) for shape in placed)  # of UsdGeomPoints; nothing else is placed
    # A double has 52 bits; matrices of three levels and of Gf round a few times each. USD moves what has velocities in floats.
    tolerance = 2.0**-23 if any(prim.GetAttribute("velocities").HasAuthoredValue() for prim in stage.Traverse()) else 1e-13
    assert_same_triangles(world_triangles(description), world_triangles(flat), tolerance)
    return description


def start(stage: Usd.Stage) -> float | None:
    return stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None


@pytest.mark.skipif(not ASSETS.is_dir(), reason="the shared assets are not here")
@pytest.mark.parametrize("path", STAGES, ids=lambda p: p.stem)
def test_public_stage(path: Path) -> None:
    stage = Usd.Stage.Open(str(path))
    first = start(stage)
    check(stage, first)
    if first is not None:
        check(stage, 0.3 * first + 0.7 * stage.GetEndTimeCode())  # between samples


NESTED = """#usda 1.0
over "Library"
{
    def Xform "Leaf"
    {
        double3 xformOp:translate = (0.5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Sphere "ball"
        {
            double3 xformOp:scale = (1, 2, 3)
            uniform token[] xformOpOrder = ["xformOp:scale"]
        }
        def Cube "box"
        {
        }
    }
    def PointInstancer "Ring"
    {
        rel prototypes = </Library/Leaf>
        int[] protoIndices = [0, 0, 0, 0]
        int64[] ids = [10, 11, 12, 13]
        int64[] invisibleIds = [12]
        point3f[] positions = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0.7071, 0, 0, 0.7071), (1, 0, 0, 0), (0.5, 0.5, 0.5, 0.5)]
        quatf[] orientationsf = [(1, 0, 0, 0), (0.7071068, 0, 0, 0.7071068), (1, 0, 0, 0), (0.5, 0.5, 0.5, 0.5)]
        float3[] scales = [(1, 1, 1), (2, 1, 1), (1, 1, 1), (1, -1, 3)]
        double3 xformOp:translate = (0, 0, 7)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
def Xform "Source"
{
    def PointInstancer "Outer"
    {
        rel prototypes = [</Library/Ring>, </Library/Leaf>]
        int[] protoIndices = [0, 1, 0]
        point3f[] positions = [(10, 0, 0), (20, 0, 0), (30, 0, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0.7071, 0.7071, 0, 0), (0.7071, 0, 0.7071, 0)]
        double xformOp:rotateX = 30
        uniform token[] xformOpOrder = ["xformOp:rotateX"]
    }
}
def Xform "A" (
    instanceable = true
    references = </Source>
)
{
    double3 xformOp:translate = (0, 100, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "B" (
    instanceable = true
    references = </Source>
)
{
    double xformOp:rotateZ = 45
    uniform token[] xformOpOrder = ["xformOp:rotateZ"]
}
"""


def test_nested_instancers_inside_native_instances() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(NESTED)
    description = check(stage, None)
    # /Source itself and its two instances: 3 x (2 rings of 3 visible + 1 leaf); the leaf is one prototype.
    assert [p.path for p in description.prototypes] == ["/Library/Leaf"]
    assert [len(p) for p in description.placements] == [21]


def test_two_levels_place_the_same_triangles() -> None:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(NESTED.replace("int[] protoIndices = [0, 1, 0]", "int[] protoIndices = [0, 0, 0]"))
    grouped = check(stage, None, RenderSettings(max_memory_bytes=12 * 200))
    # 18 balls and boxes come from 3 of the ring and 6 rings.
    assert [len(p.placements) for p in grouped.prototypes] == [0, 1]
    assert [len(p) for p in (*grouped.placements, *grouped.prototypes[1].placements)] == [9, 3]


def test_matrices_are_those_of_usd_to_the_last_digits() -> None:
    """With quaternions that are exactly unit length, which USD does not make so itself."""
    rng = np.random.default_rng(4)
    count = 5000
    stage = Usd.Stage.CreateInMemory()
    instancer = UsdGeom.PointInstancer.Define(stage, "/p")
    ball = UsdGeom.Sphere.Define(stage, "/p/ball")
    ball.AddRotateXYZOp().Set((10, 20, 30))
    instancer.CreatePrototypesRel().AddTarget("/p/ball")
    instancer.CreateProtoIndicesAttr(Vt.IntArray(count))
    positions = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-3, 6, (count, 1))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions.astype(np.float32)))
    scales = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-3, 3, (count, 3))
    scales[::7, 1] = 0.0
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(scales.astype(np.float32)))
    quaternions = rng.choice([-0.5, 0.5], (count, 4))
    quaternions[::5] = np.eye(4)[rng.integers(0, 4, len(quaternions[::5]))]
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(quaternions.astype(np.float16)))
    instancer.CreateIdsAttr(Vt.Int64Array.FromNumpy(rng.permutation(count).astype(np.int64) // 2))  # each twice
    instancer.CreateInvisibleIdsAttr(Vt.Int64Array([3, 17, count, -1]))
    instancer.DeactivateIds(Vt.Int64Array([17, 40]))
    matrices = instancer.ComputeInstanceTransformsAtTime(Usd.TimeCode.Default(), Usd.TimeCode.Default())
    expected = np.array([np.array(m).T[:3] for m in matrices])
    description, _ = translate(stage, RenderSettings())
    (placement,), (prototype,) = description.placements, description.prototypes
    assert len(placement) == len(expected) == count - 6
    found = world_from_prototype(placement) @ prototype.shapes[0].matrix
    assert (np.abs(found - expected) <= 4 * np.spacing(np.abs(expected).max(axis=2, keepdims=True))).all()
