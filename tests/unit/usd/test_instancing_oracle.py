"""Every instance stands where USD's own functions put it: instance proxies and ComputeInstanceTransformsAtTime."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom
from tests.described import world_from_prototype

from primray.description import Mesh, SceneDescription
from primray.settings import RenderSettings
from primray.usd import translate

ASSETS = Path(os.environ.get("PRIMRAY_ASSETS", Path(__file__).parents[4] / "shared" / "assets"))
STAGES = [*sorted(ASSETS.glob("pixar-imaging/*/*.usda")), ASSETS / "intent-vfx/scenes/simpleAssetScene.usd"]
SHAPES = ("Mesh", "Sphere", "Cube", "Cone", "Cylinder", "Capsule", "Plane")
HERE = Path(__file__).parent


def oracle(stage: Usd.Stage, time: Usd.TimeCode) -> list[Gf.Matrix4d]:
    """World matrices of all visible shapes of purpose default and render, one prim at a time."""
    found: list[Gf.Matrix4d] = []

    def visit(prim: Usd.Prim, parent: Gf.Matrix4d, purpose: str, own: Gf.Matrix4d | None = None) -> None:
        imageable = UsdGeom.Imageable(prim)
        if imageable and imageable.GetVisibilityAttr().Get(time) == "invisible":
            return
        if imageable and imageable.GetPurposeAttr().HasAuthoredValue():
            purpose = imageable.GetPurposeAttr().Get()
        xformable = UsdGeom.Xformable(prim)
        local = xformable.GetLocalTransformation(time) if xformable else Gf.Matrix4d(1)
        world = own if own is not None else local * parent
        if prim.IsA(UsdGeom.PointInstancer):
            visit_points(UsdGeom.PointInstancer(prim), world, purpose)
            return
        if str(prim.GetTypeName()) in SHAPES and purpose in ("default", "render"):
            found.append(world)
        for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies(predicate(prim))):
            visit(child, world, purpose)

    def predicate(prim: Usd.Prim) -> object:
        return Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier & ~Usd.PrimIsAbstract

    def visit_points(instancer: UsdGeom.PointInstancer, world: Gf.Matrix4d, purpose: str) -> None:
        matrices = instancer.ComputeInstanceTransformsAtTime(time, time)
        indices = instancer.GetProtoIndicesAttr().Get(time)
        mask = instancer.ComputeMaskAtTime(time)
        if indices is None:
            return
        chosen = [i for i, shown in zip(indices, mask, strict=True) if shown] if mask else list(indices)
        roots = instancer.GetPrototypesRel().GetForwardedTargets()
        for matrix, index in zip(matrices, chosen, strict=False):
            root = instancer.GetPrim().GetStage().GetPrimAtPath(roots[index]) if 0 <= index < len(roots) else None
            if root:
                visit(root, Gf.Matrix4d(1), purpose, own=Gf.Matrix4d(matrix) * world)

    for child in stage.GetPseudoRoot().GetFilteredChildren(Usd.PrimDefaultPredicate):
        visit(child, Gf.Matrix4d(1), "default")
    return found


def placed(description: SceneDescription) -> np.ndarray:
    """(N, 4, 4): the world matrices of all shapes."""
    matrices = [p.matrix[None] for p in description.static]
    for placement in description.placements:
        world = np.zeros((len(placement), 4, 4))
        world[:, :3] = world_from_prototype(placement)
        world[:, 3, 3] = 1
        matrices += [world @ p.matrix for p in description.prototypes[placement.prototype].shapes]
    return np.concatenate(matrices) if matrices else np.zeros((0, 4, 4))


def check(stage: Usd.Stage) -> None:
    time_code = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    description, _ = translate(stage, RenderSettings(time_code=time_code))
    time = Usd.TimeCode.Default() if time_code is None else Usd.TimeCode(time_code)
    expected = np.array([np.array(m).T for m in oracle(stage, time)]).reshape(-1, 4, 4)
    found = placed(description)
    # Meshes that hold no triangles are dropped by translation; none of these stages has any.
    assert all(len(s.triangles) for s in description.shapes if isinstance(s, Mesh))
    assert len(found) == len(expected)
    if len(found) == 0:
        return
    scale = max(1.0, float(np.abs(expected).max()))
    free = np.ones(len(found), bool)
    flat = found.reshape(-1, 16)
    for matrix in expected.reshape(-1, 16):
        distance = np.where(free, np.abs(flat - matrix).max(axis=1), np.inf)
        best = int(distance.argmin())
        assert distance[best] < 4e-3 * scale  # USD does not renormalise half quaternions, we do
        free[best] = False


@pytest.mark.skipif(not ASSETS.is_dir(), reason="the shared assets are not here")
@pytest.mark.parametrize("path", STAGES, ids=lambda p: p.stem)
def test_public_stage(path: Path) -> None:
    check(Usd.Stage.Open(str(path)))


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
    check(stage)
    description, _ = translate(stage, RenderSettings())
    # /Source itself and its two instances: 3 x (2 rings of 3 visible + 1 leaf); the leaf is one prototype.
    assert [p.path for p in description.prototypes] == ["/Library/Leaf"]
    assert [len(p) for p in description.placements] == [21]
