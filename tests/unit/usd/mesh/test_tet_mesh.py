"""TetMesh: its surface is that of the same Mesh, authored or found from the tetrahedra, with subsets of either."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt
from tests.translation.describe import describe

from primray.description import Mesh
from primray.settings import RenderSettings
from primray.usd import translate
from primray.usd.mesh.authored import is_closed
from primray.usd.mesh.tet_mesh import Tetrahedra, surface_of

from ..usd_text import stage_of, translate_text

# A unit cube in five tetrahedra about the one in its middle, and one that stands alone.
POINTS = "[(0,0,0), (1,0,0), (0,1,0), (1,1,0), (0,0,1), (1,0,1), (0,1,1), (1,1,1), (3,0,0), (4,0,0), (3,1,0), (3,0,1)]"
CUBE = [(0, 1, 3, 5), (0, 3, 2, 6), (0, 6, 4, 5), (3, 6, 5, 7), (0, 3, 6, 5), (8, 9, 10, 11)]
LOOKS = """def Material "red"
{
    token outputs:surface.connect = </red/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        token outputs:surface
    }
}
"""


def tets_of(body: str = "", surface: str = "", tets: str = str(CUBE), points: str = POINTS) -> str:
    indices = f"int4[] tetVertexIndices = {tets}" if tets else ""
    return f'def TetMesh "t"\n{{\npoint3f[] points = {points}\n{indices}\n{surface}\n{body}\n}}\n'


def mesh_of(body: str, faces: list[list[int]]) -> str:
    flat = [i for face in faces for i in face]
    return (
        f'def Mesh "t"\n{{\npoint3f[] points = {POINTS}\nuniform token subdivisionScheme = "none"\n'
        f"int[] faceVertexCounts = {[3] * len(faces)}\nint[] faceVertexIndices = {flat}\n{body}\n}}\n"
    )


def described(text: str) -> str:
    return describe(*translate(stage_of(text), RenderSettings()), "")


def shape_of(text: str) -> Mesh:
    (shape,) = translate_text(text)[0].shapes
    assert isinstance(shape, Mesh)
    return shape


def volume(shape: Mesh) -> float:
    a, b, c = (shape.points[shape.triangles[:, k]].astype(np.float64) for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


COLORS = "color3f[] primvars:displayColor = [" + ", ".join(f"(0.{k:02}, 0.5, 0.5)" for k in range(12)) + "]"
PER_POINT = '(\ninterpolation = "vertex"\n)'


@pytest.mark.conforms("TetMesh.surfaceFaceVertexIndices")
@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_an_authored_surface_is_the_same_mesh(orientation: str) -> None:
    faces = [[0, 2, 1], [1, 3, 5], [9, 10, 11], [4, 5, 6]]
    normals = "normal3f[] normals = [" + ", ".join(["(0, 0.6, 0.8)"] * 12) + "]"
    body = f'{COLORS} {PER_POINT}\n{normals}\nuniform token orientation = "{orientation}"'
    surface = f"int3[] surfaceFaceVertexIndices = {[tuple(face) for face in faces]}"
    assert described(tets_of(body, surface)) == described(mesh_of(body, faces))
    assert described(tets_of(body, surface, tets="")) == described(mesh_of(body, faces))
    assert described(tets_of(body)) != described(mesh_of(body, faces))


@pytest.mark.conforms("TetMesh.tetVertexIndices")
def test_a_surface_is_found_where_none_is_authored() -> None:
    """Closed, outside outside, around the volume that the tetrahedra fill."""
    shape = shape_of(tets_of())
    assert len(shape.triangles) == 12 + 4
    assert is_closed(shape.points, shape.triangles)
    assert volume(shape) == pytest.approx(1 + 1 / 6, rel=1e-6)
    left = shape_of(tets_of('uniform token orientation = "leftHanded"'))
    assert volume(left) == pytest.approx(volume(shape), rel=1e-6)  # the text turns the tetrahedron's faces with it
    assert shape_of(tets_of(surface="int3[] surfaceFaceVertexIndices = []")).triangles.tolist() == shape.triangles.tolist()


def test_faces_are_those_that_usd_computes_in_its_order() -> None:
    rng, stage = np.random.default_rng(7), Usd.Stage.CreateInMemory()
    for _ in range(20):
        tets = np.array([rng.permutation(9)[:4] for _ in range(12)], np.int32)
        usd = UsdGeom.TetMesh.Define(stage, "/t")
        usd.GetTetVertexIndicesAttr().Set(Vt.Vec4iArray.FromNumpy(tets))
        expected = np.asarray(UsdGeom.TetMesh.ComputeSurfaceFaces(usd, Usd.TimeCode.Default()))
        key = np.sort(tets, axis=1)
        if len(np.unique(key, axis=0)) == len(key):
            assert surface_of(tets).tolist() == expected.tolist()


def test_faces_know_their_tetrahedra() -> None:
    tets = np.array(CUBE, np.int32)
    surface = surface_of(tets)
    owners = Tetrahedra(tets, surface).owners()
    assert all(set(face) <= set(tets[owner]) for face, owner in zip(surface.tolist(), owners, strict=True))
    assert Tetrahedra(tets, np.array([[0, 1, 11]], np.int32)).owners().tolist() == [-1]


@pytest.mark.parametrize(("element", "indices", "worn"), [("tetrahedron", "[5]", 4), ("face", "[0, 1]", 2)])
def test_subsets(element: str, indices: str, worn: int) -> None:
    subset = f"""def GeomSubset "s" (prepend apiSchemas = ["MaterialBindingAPI"])
    {{
        uniform token elementType = "{element}"
        uniform token familyName = "materialBind"
        int[] indices = {indices}
        rel material:binding = </red>
    }}"""
    description, told = translate_text(LOOKS + tets_of(subset))
    (shape,) = description.shapes
    assert isinstance(shape, Mesh)
    red = [k for k, s in enumerate(description.surfaces) if s.diffuse_color == (1, 0, 0)]
    faces = shape.triangles[np.asarray(shape.surface) == red[0]]
    assert len(faces) == worn
    assert (element == "face") or faces.min() >= 8
    assert [code for code, path in told if path.startswith("/t")] == []
    _, told = translate_text(LOOKS + tets_of(subset.replace(indices, "[99]")))
    assert ("subset-ignored", "/t/s") in told


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (tets_of(tets=""), "invalid-mesh"),
        (tets_of(tets="[]"), "invalid-mesh"),
        (tets_of(tets="[(0, 1, 2, 77), (8, 9, 10, 11)]"), "faces-dropped"),
        (tets_of(points="[]", tets="[(0, 1, 2, 3)]"), "faces-dropped"),
    ],
)
def test_what_does_not_fit_is_told(text: str, code: str) -> None:
    assert (code, "/t") in translate_text(text)[1]


def test_two_that_are_one_have_no_face_of_one_alone() -> None:
    description, told = translate_text(tets_of(tets="[(0, 1, 2, 4), (0, 1, 2, 4)]"))
    assert description.shapes == ()
    assert ("invalid-mesh", "/t") in told


def test_it_moves_with_its_points() -> None:
    moved = POINTS.replace("(3,0,1)", "(3,0,2)")
    body = f"point3f[] points.timeSamples = {{ 0: {POINTS}, 1: {moved} }}"
    text = tets_of(body).replace(f"point3f[] points = {POINTS}\n", "", 1)
    text += 'def Camera "c"\n{\ndouble shutter:open = 0\ndouble shutter:close = 1\ndouble3 xformOp:translate = (0, 0, 9)\n'
    text += 'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    (shape,) = translate_text(text, RenderSettings(time_code=0.0))[0].shapes
    assert isinstance(shape, Mesh)
    assert shape.motion is not None
    assert shape.motion.points[-1].max() == 4
    assert shape.motion.points[-1][11].tolist() == [3, 0, 2]
