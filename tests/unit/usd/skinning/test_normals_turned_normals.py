"""Normals of posed curves and TetMeshes, in every form in which they can be authored: those of the same shape bent by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel

from primray.description import Mesh, Ribbons
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.skinning.normals import _points_of

from ..skinned_text import WAVE, bones, placed
from ..usd_text import stage_of

SCALED = WAVE.replace("half3[] scales = [(1, 1, 1), (1, 1, 1)]", "half3[] scales = [(1, 1, 1), (1, 1, 4)]")
TURN = np.array([(0.5, 0, 0.75**0.5), (0, 1, 0), (-(0.75**0.5), 0, 0.5)])  # 60 degrees about y
HIGH = TURN @ np.diag((1, 1, 4))  # what the second joint does to vectors; at 10 it also moves points by (2, 1, 0)


@dataclass(frozen=True)
class Shape:
    """A prim as text, its points, which of them follow the second joint, and how many normals each interpolation has."""

    kind: str
    body: str
    points: np.ndarray
    high: np.ndarray
    point_of: dict[str, list[int]]  # by interpolation, a point that each value belongs to


def curves(kind: str, body: str, count: int, ends: list[int]) -> Shape:
    """Two curves of `count` vertices, the second of which follows the second joint; `ends`: of the first one's segments."""
    along = np.linspace(-1, 1, count)
    one = np.stack([along, 0.3 * np.sin(3 * along), 0.2 * along], axis=1)
    points = np.concatenate([one, one + (0, 1, 0)])
    both = [*ends, *(end + count for end in ends)]
    of = {"vertex": list(range(2 * count)), "varying": both, "faceVarying": both, "uniform": [0, count]}
    return Shape(
        kind,
        f'int[] curveVertexCounts = [{count}, {count}]\nfloat[] widths = [0.2] (interpolation = "constant")\n{body}',
        points,
        np.arange(2 * count) >= count,
        of,
    )


def basis(count: int, ends: list[int], basis: str, wrap: str = "nonperiodic") -> Shape:
    kind = "linear" if basis == "linear" else "cubic"
    of_basis = "" if basis == "linear" else f'uniform token basis = "{basis}"\n'
    return curves("BasisCurves", f'uniform token type = "{kind}"\n{of_basis}uniform token wrap = "{wrap}"', count, ends)


TETS = Shape(
    "TetMesh",
    "int4[] tetVertexIndices = [(0, 1, 2, 3), (4, 5, 6, 7)]",
    np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, -1), (0, 2, 0), (1, 2, 0), (0, 3, 0), (0, 2, -1)], float),
    np.arange(8) >= 4,
    {"vertex": list(range(8)), "varying": list(range(8)), "uniform": [0] * 4 + [4] * 4, "faceVarying": [0] * 12 + [4] * 12},
)
SHAPES = {
    "linear": basis(3, [0, 1, 2], "linear"),
    "linear periodic": basis(3, [0, 1, 2], "linear", "periodic"),
    "bezier": basis(7, [0, 3, 6], "bezier"),
    "bezier periodic": basis(6, [0, 3], "bezier", "periodic"),
    "bspline": basis(5, [1, 2, 3], "bspline"),
    "bspline pinned": basis(4, [0, 1, 2, 3], "bspline", "pinned"),
    "catmullRom": basis(5, [1, 2, 3], "catmullRom"),
    "catmullRom periodic": basis(4, [0, 1, 2, 3], "catmullRom", "periodic"),
    "hermite": curves("HermiteCurves", f"vector3f[] tangents = {[(1, 0, 0)] * 6}", 3, [0, 1, 2]),
    "nurbs": curves("NurbsCurves", f"int[] order = [4, 4]\ndouble[] knots = {[0, 0, 0, 0, 1, 2, 2, 2, 2] * 2}", 5, [0, 2, 4]),
    "tets": TETS,
    "tets left-handed": replace(TETS, body=TETS.body + '\nuniform token orientation = "leftHanded"'),
    "surface": replace(TETS, body=TETS.body + "\nint3[] surfaceFaceVertexIndices = [(0, 1, 2), (4, 5, 6)]", point_of={
        **TETS.point_of, "uniform": [0, 4], "faceVarying": [0] * 3 + [4] * 3
    }),
}  # fmt: skip


def values(array: np.ndarray) -> str:
    return str([tuple(row) for row in np.round(array, 9).tolist()])


def turned(normals: np.ndarray, high: np.ndarray) -> np.ndarray:
    found = np.where(high[:, None], normals @ np.linalg.inv(HIGH), normals)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def authored(name: str, normals: np.ndarray, interpolation: str, *, indexed: bool = False) -> str:
    if not indexed:
        return f'normal3f[] {name} = {values(normals)} (interpolation = "{interpolation}")'
    back = list(range(len(normals)))[::-1]
    return f"{authored(name, normals[::-1], interpolation)}\nint[] {name}:indices = {back}"


def found(text: str) -> np.ndarray:
    """(N, 3) normals of the only shape, as its description has them, in the world."""
    description, diagnostics = translate(stage_of(text), RenderSettings(time_code=10.0))
    assert not {d.code for d in diagnostics} & {"invalid-primvar", "skinning", "usd-message"}
    (shape,) = description.shapes
    assert isinstance(shape, Mesh | Ribbons)
    assert shape.normals is not None
    lengths = np.linalg.norm(shape.normals, axis=1, keepdims=True)
    return np.asarray(shape.normals / np.where(lengths > 0, lengths, 1))


def posed(shape: Shape, normals: str) -> str:
    joints = shape.high.astype(int).tolist()
    weights = f"""int[] primvars:skel:jointIndices = {joints} (
    elementSize = 1
    interpolation = "vertex"
)
float[] primvars:skel:jointWeights = {[1] * len(joints)} (
    elementSize = 1
    interpolation = "vertex"
)
rel skel:skeleton = </char/bones>"""
    body = f"{shape.body}\npoint3f[] points = {values(shape.points)}\n{weights}\n{normals}\n"
    bound = bones("rel skel:animationSource = </char/wave>") + SCALED
    return placed(
        "def SkelRoot", "char", bound + placed(f"def {shape.kind}", "m", body, header='prepend apiSchemas = ["SkelBindingAPI"]')
    )


def by_hand(shape: Shape, normals: str) -> str:
    points = np.where(shape.high[:, None], shape.points @ HIGH.T + (2, 1, 0), shape.points + (2, 0, 0))
    return f'def {shape.kind} "m"\n{{\n{shape.body}\npoint3f[] points = {values(points)}\n{normals}\n}}\n'


FORMS = [("normals", False), ("primvars:normals", False), ("primvars:normals", True)]


@pytest.mark.parametrize(("name", "indexed"), FORMS, ids=["attribute", "primvar", "indexed"])
@pytest.mark.parametrize("interpolation", ["vertex", "varying", "faceVarying", "uniform", "constant"])
@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_normals_turn_with_joints(shape: Shape, interpolation: str, name: str, indexed: bool) -> None:
    if interpolation == "constant":  # which is two values once half of the shape has turned
        of, expected_as = np.zeros(1, int), np.arange(len(shape.points))
        after = authored("normals", turned(np.tile([(0.48, 0.6, 0.64)], (len(expected_as), 1)), shape.high), "vertex")
        normals = np.array([(0.48, 0.6, 0.64)])
    else:
        of = np.array(shape.point_of[interpolation])
        normals = np.random.default_rng(len(of)).normal(size=(len(of), 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        after = authored("normals", turned(normals, shape.high[of]), interpolation)
    given = authored(name, normals, interpolation, indexed=indexed)
    np.testing.assert_allclose(found(posed(shape, given)), found(by_hand(shape, after)), atol=2e-5)


@pytest.mark.parametrize("shape", [shape for shape in SHAPES.values() if shape.kind != "TetMesh"], ids=lambda shape: shape.kind)
def test_values_at_ends_belong_to_the_vertices_there(shape: Shape) -> None:
    stage = stage_of(by_hand(shape, ""))
    owners = _points_of(stage.GetPrimAtPath("/m"), "varying")
    assert owners is not None
    if len(owners) != len(shape.points):  # as many as the points are turned by UsdSkel, in their order
        assert owners.tolist() == shape.point_of["varying"]


def test_they_turn_as_usdskel_turns_those_of_points() -> None:
    """Of several joints at a point: a shape whose normals are per end is turned as one that has them per point."""
    rng = np.random.default_rng(3)
    weights = rng.dirichlet((1, 1), 14).ravel().tolist()
    shape = SHAPES["bezier"]
    normals = rng.normal(size=(14, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ends = shape.point_of["varying"]

    def stage(given: str) -> Usd.Stage:
        text = posed(shape, given)
        head, _, tail = text.partition("int[] primvars:skel:jointIndices")
        _, _, tail = tail.partition("rel skel:skeleton")
        blended = f"""int[] primvars:skel:jointIndices = {[0, 1] * 14} (
    elementSize = 2
    interpolation = "vertex"
)
float[] primvars:skel:jointWeights = {weights} (
    elementSize = 2
    interpolation = "vertex"
)
matrix4d primvars:skel:geomBindTransform = ((0, 2, 0, 0), (-1, 0, 0, 0), (0, 0, 3, 0), (0, 0, 1, 1))
double3 xformOp:rotateXYZ = (10, 20, 30)
uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
"""
        return stage_of(f"{head}{blended}rel skel:skeleton{tail}")

    baked = stage(authored("normals", normals, "vertex"))
    assert UsdSkel.BakeSkinning(UsdSkel.Root(baked.GetPrimAtPath("/char")))
    expected = np.array(UsdGeom.PointBased(baked.GetPrimAtPath("/char/m")).GetNormalsAttr().Get(10.0))[ends]
    description, _ = translate(stage(authored("normals", normals[ends], "varying")), RenderSettings(time_code=10.0))
    (ribbons,) = description.shapes
    assert isinstance(ribbons, Ribbons)
    np.testing.assert_allclose(ribbons.normals[[0, 3, 6, 7, 10, 13]], expected, atol=1e-5)


def test_normals_follow_while_the_shutter_is_open() -> None:
    shape = SHAPES["tets"]
    camera = 'def Camera "eye"\n{\ndouble shutter:open = -1\ndouble shutter:close = 0\n}\n'
    normals = np.tile([(0.0, 0.6, 0.8)], (24, 1))
    moving = posed(shape, authored("normals", normals, "faceVarying")).replace(
        "quatf[] rotations = [(1, 0, 0, 0), (0.8660254, 0, 0.5, 0)]",
        "quatf[] rotations.timeSamples = { 0: [(1, 0, 0, 0), (1, 0, 0, 0)], 10: [(1, 0, 0, 0), (0.8660254, 0, 0.5, 0)] }",
    )
    assert "rotations.timeSamples" in moving
    description, _ = translate(stage_of(camera + moving), RenderSettings(time_code=10.0, camera="/eye"))
    (mesh,) = description.shapes
    assert isinstance(mesh, Mesh)
    assert mesh.motion is not None
    assert mesh.motion.normals is not None
    first, last = (np.asarray(mesh.motion.normals)[k] for k in (0, -1))
    assert np.abs(first - last).max() > 0.02
    np.testing.assert_allclose(
        last[first.shape[0] // 2 :], np.tile(turned(normals[:1], np.array([True])), (first.shape[0] // 2, 1)), atol=1e-5
    )
