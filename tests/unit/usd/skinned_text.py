"""Skinned characters as text, their parts in files of their own where asked, and where USD's own skinning puts their points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel, Vt

from primray.description import Mesh, SceneDescription
from primray.description.placement import MatrixInstances

Shifted = Callable[[np.ndarray], np.ndarray]
UNIT = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
API = 'prepend apiSchemas = ["SkelBindingAPI"]'
TURN_60 = "(0.8660254, 0, 0.5, 0)"  # about y
BONES = f"""def Skeleton "bones" (
    {API}
)
{{
    uniform token[] joints = ["low", "low/high"]
    uniform matrix4d[] bindTransforms = [{UNIT}, {UNIT}]
    uniform matrix4d[] restTransforms = [{UNIT}, {UNIT}]
    BOUND
}}
"""
WAVE = """def SkelAnimation "wave"
{
    uniform token[] joints = ["low", "low/high"]
    float3[] translations.timeSamples = {
        0: [(0, 0, 0), (0, 0, 0)],
        10: [(2, 0, 0), (0, 1, 0)],
    }
    quatf[] rotations = [(1, 0, 0, 0), TURN]
    half3[] scales = [(1, 1, 1), (1, 1, 1)]
}
""".replace("TURN", TURN_60)
WEIGHTS = """int[] primvars:skel:jointIndices = [0, 1, 0, 1, 0, 1, 0, 1] (
    elementSize = 2
    interpolation = "vertex"
)
float[] primvars:skel:jointWeights = [1, 0, 0.5, 0.5, 0, 1, 0.25, 0.75] (
    elementSize = 2
    interpolation = "vertex"
)
"""
RIGID = """int[] primvars:skel:jointIndices = [1] (
    elementSize = 1
    interpolation = "constant"
)
float[] primvars:skel:jointWeights = [1] (
    elementSize = 1
    interpolation = "constant"
)
"""


def bones(bound: str = "") -> str:
    return BONES.replace("BOUND", bound)


def skin(more: str = "", weights: str = WEIGHTS, header: str = API) -> str:
    return f"""def Mesh "skin" (
{header}
)
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0.25), (-0.5, 0.5, 0)]
    {weights}
    {more}
}}
"""


def placed(kind: str, name: str, body: str, x: float = 0, header: str = "") -> str:
    moved = f'double3 xformOp:translate = ({x}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n' if x else ""
    return f'{kind} "{name}" (\n{header}\n)\n{{\n{moved}{body}\n}}\n'


def instance(kind: str, name: str, of: str, body: str = "", x: float = 0) -> str:
    return placed(kind, name, body, x, f"instanceable = true\n{API}\nprepend inherits = <{of}>")


def character(more: str = "") -> str:
    """What stands in a SkelRoot whose path is that of its own parts: targets are relative."""
    bound = bones("rel skel:animationSource = <../wave>")
    return bound + WAVE + skin(f"rel skel:skeleton = <../bones>\n{more}")


def points_of_usd(stage: Usd.Stage, time: float, shifted: Shifted | None = None) -> np.ndarray:
    """(N, 3) in the world: what UsdSkelCache finds through instance proxies, skinned by its queries.

    `shifted`: by how much blend shapes of these weights shift a mesh's points.
    """
    found = []
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if prim.GetTypeName() == "SkelRoot":
            found += _points_below(UsdSkel.Root(prim), time, shifted)
    return np.concatenate(found)


def _points_below(root: UsdSkel.Root, time: float, shifted: Shifted | None) -> list[np.ndarray]:
    cache, found = UsdSkel.Cache(), []
    cache.Populate(root, Usd.TraverseInstanceProxies())
    for binding in cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies()):
        world_from_skeleton = np.array(binding.GetSkeleton().ComputeLocalToWorldTransform(time))
        joints = cache.GetSkelQuery(binding.GetSkeleton()).ComputeSkinningTransforms(time)
        for query in binding.GetSkinningTargets():
            points = UsdGeom.PointBased(query.GetPrim()).GetPointsAttr().Get(time)
            if shifted is not None and query.HasBlendShapes():
                weights = cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery().ComputeBlendShapeWeights(time)
                points = Vt.Vec3fArray.FromNumpy((np.array(points) + shifted(np.array(weights))).astype(np.float32))
            assert query.ComputeSkinnedPoints(joints, points, time)
            found.append(np.array(points) @ world_from_skeleton[:3, :3] + world_from_skeleton[3, :3])
    return found


def points_of(description: SceneDescription) -> np.ndarray:
    """(N, 3) in the world, of all meshes."""
    found = [_moved(description, shape.shape, shape.matrix) for shape in description.static]
    for placement in description.placements:
        (level,) = placement.levels
        assert isinstance(level, MatrixInstances)
        for matrix in level.matrices:
            world = np.vstack([matrix, (0, 0, 0, 1)])
            found += [
                _moved(description, s.shape, world @ s.matrix) for s in description.prototypes[placement.prototype].shapes
            ]
    return np.concatenate(found)


def _moved(description: SceneDescription, shape: int, matrix: np.ndarray) -> np.ndarray:
    mesh = description.shapes[shape]
    assert isinstance(mesh, Mesh)
    return mesh.points @ matrix[:3, :3].T + matrix[:3, 3]


def in_order(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(np.round(points, 3).T)]
