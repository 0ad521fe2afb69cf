"""Meshes: winding, normals by precedence, colours in every interpolation, closedness."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.usd.mesh.mesh_text import QUADS

from primray.description import Mesh, SceneDescription
from primray.usd.mesh.authored import is_closed

from ..usd_text import translate_text


def mesh(body: str = "", extra: str = "") -> tuple[Mesh, SceneDescription, list[str]]:
    description, found = translate_text(QUADS.replace("BODY", body).replace("EXTRA", extra))
    (shape,) = description.shapes
    assert isinstance(shape, Mesh)
    return shape, description, [code for code, path in found if path.startswith("/mesh")]


def face_normals(shape: Mesh) -> np.ndarray:
    p = shape.points[shape.triangles]
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def test_triangles_and_winding() -> None:
    shape, _, codes = mesh()
    assert shape.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 2]]
    assert (face_normals(shape)[:, 2] > 0).all()
    assert shape.normals is None
    assert codes == []


@pytest.mark.conforms("Gprim.orientation")
def test_left_handed_meshes_turn() -> None:
    shape, _, _ = mesh(
        'uniform token orientation = "leftHanded"\n'
        "    normal3f[] normals = [(0, 0, -1), (0, 0, -1), (0, 0, -1), (0, 0, -1), (0, 0, 0)]"
    )
    assert (face_normals(shape)[:, 2] < 0).all()
    assert shape.normals is not None
    assert (shape.normals == (0, 0, -1)).all()  # also the zero one, which takes the face's normal


@pytest.mark.conforms("PointBased.normals")
def test_primvars_normals_beat_normals() -> None:
    normals = "normal3f[] normals = [(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)]"
    assert np.all(mesh(normals)[0].normals == (1, 0, 0))
    indexed = 'normal3f[] primvars:normals = [(0, 2, 0), (0, 0, 3)] (\n        interpolation = "uniform"\n    )\n'
    indexed += "    int[] primvars:normals:indices = [1, 0]"
    shape, _, _ = mesh(normals + "\n    " + indexed)
    assert shape.normals is not None
    assert shape.normals.tolist() == [[0, 0, 1]] * 6 + [[0, 1, 0]] * 3
    varying = "\n    ".join(
        [normals, 'normal3f[] primvars:normals = [(0, 1, 0)] (\n        interpolation = "faceVarying"\n    )']
    )
    shape, _, codes = mesh(varying)
    assert shape.normals is None  # primvars:normals still wins, but does not fit
    assert codes == ["invalid-primvar"]


@pytest.mark.parametrize("normals", ["float normals = 1", "asset normals = @n@", 'string normals = "n"'])
def test_normals_that_are_no_array_are_noted(normals: str) -> None:
    shape, _, codes = mesh(normals)
    assert shape.normals is None
    assert codes == ["invalid-primvar"]


@pytest.mark.conforms("PointBased.normals")
def test_face_varying_normals_follow_corners() -> None:
    values = ", ".join(f"(0, {k}, 1)" for k in range(7))
    shape, _, _ = mesh(f'normal3f[] normals = [{values}] (\n        interpolation = "faceVarying"\n    )')
    assert shape.normals is not None
    ratio = shape.normals[:, 1] / shape.normals[:, 2]
    assert ratio.round(4).tolist() == [0, 1, 2, 0, 2, 3, 4, 5, 6]
    assert np.allclose(np.linalg.norm(shape.normals, axis=1), 1)


@pytest.mark.parametrize(
    ("interpolation", "values", "expected"),
    [
        ("uniform", 2, [0, 0, 1]),
        ("vertex", 5, [0, 1, 2, 3, 4]),
        ("varying", 5, [0, 1, 2, 3, 4]),
        ("faceVarying", 7, [0, 1, 2, 0, 2, 3, 4, 5, 6]),
    ],
)
@pytest.mark.conforms("Gprim.primvars:displayColor")
def test_display_color(interpolation: str, values: int, expected: list[int]) -> None:
    colors = ", ".join(f"({k / 8}, 0, 0)" for k in range(values))
    shape, description, _ = mesh(
        f'color3f[] primvars:displayColor = [{colors}] (\n        interpolation = "{interpolation}"\n    )'
    )
    assert shape.colors is not None
    assert (shape.colors[:, 0] * 8).tolist() == expected
    assert description.surfaces[0].diffuse_color == (1, 1, 1)
    assert description.surfaces[0].lambert


def test_constant_colors_are_inherited_and_deduplicated() -> None:
    grey = 'def Mesh "b"\n{\n' + QUADS.split("{", 1)[1].replace("BODY", "")
    text = (
        'def Xform "x"\n{\n    color3f[] primvars:displayColor = [(0.5, 0.25, 0)]\n'
        + QUADS.replace("BODY", "").replace("EXTRA", "")
        + grey
        + "}\n"
    )
    description, _ = translate_text(text)
    assert [s.surface for s in description.shapes] == [0, 0]
    assert description.surfaces[0].diffuse_color == (0.5, 0.25, 0)
    assert mesh()[1].surfaces[0].diffuse_color == (0.18, 0.18, 0.18)


def test_colors_per_point_are_not_inherited() -> None:
    colors = 'color3f[] primvars:displayColor = [(0.5, 0.25, 0)] (\n        interpolation = "vertex"\n    )\n'
    text = 'def Xform "x"\n{\n' + colors + QUADS.replace("BODY", "").replace("EXTRA", "") + "}\n"
    assert translate_text(text)[0].surfaces[0].diffuse_color == (0.18, 0.18, 0.18)


SOUP = """def Mesh "soup"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [5, 4, 3, 0, 2, 1]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 0, 0), (6, 0, 0), (5, 1, 0)]
    color3f[] primvars:displayColor = [(0, 0, 0), (0.1, 0, 0), (0.2, 0, 0), (0.3, 0, 0), (0.4, 0, 0), (0.5, 0, 0)] (
        interpolation = "INTERPOLATION"
    )
}
"""


@pytest.mark.parametrize(("interpolation", "expected"), [("vertex", [5, 4, 3, 0, 2, 1]), ("faceVarying", [0, 1, 2, 3, 4, 5])])
def test_as_many_points_as_corners(interpolation: str, expected: list[int]) -> None:
    """The seam cannot tell the two apart by length, so points come in corner order and both readings agree."""
    shape = translate_text(SOUP.replace("INTERPOLATION", interpolation))[0].shapes[0]
    assert isinstance(shape, Mesh)
    assert shape.colors is not None
    assert shape.triangles.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert shape.points[:, 0].tolist() == [5, 6, 5, 0, 0, 1]
    assert (shape.colors[:, 0] * 10).round(3).tolist() == expected


def test_as_many_points_as_triangles() -> None:
    tetrahedron = """def Mesh "t"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    color3f[] primvars:displayColor = [(0, 0, 0), (0.1, 0, 0), (0.2, 0, 0), (0.3, 0, 0)] (
        interpolation = "INTERPOLATION"
    )
}
"""
    for interpolation, expected in (
        ("uniform", [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]),
        ("vertex", [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]),
    ):
        shape = translate_text(tetrahedron.replace("INTERPOLATION", interpolation))[0].shapes[0]
        assert isinstance(shape, Mesh)
        assert shape.colors is not None
        assert (shape.colors[:, 0] * 10).round(3).tolist() == expected


def test_closedness() -> None:
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    faces = np.array(
        [
            [0, 1, 3],
            [0, 3, 2],
            [4, 6, 7],
            [4, 7, 5],
            [0, 4, 5],
            [0, 5, 1],
            [2, 3, 7],
            [2, 7, 6],
            [0, 2, 6],
            [0, 6, 4],
            [1, 5, 7],
            [1, 7, 3],
        ],
        np.int32,
    )
    assert is_closed(cube, faces)
    assert not is_closed(cube, faces[1:])
    split = faces.ravel()
    assert is_closed(cube[split], np.arange(36, dtype=np.int32).reshape(-1, 3))  # points that are not shared
    turned = faces.copy()
    turned[0] = turned[0][::-1]
    assert not is_closed(cube, turned)
    assert not is_closed(cube, np.concatenate([faces, faces]))  # more than two faces at every edge


def test_meshes_of_the_same_faces_keep_their_own_points() -> None:
    """A flat square, the same again, one whose second corner is pushed in, one with too few points, one without area."""
    square = "(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)"
    every = [square, square, "(0, 0, 0), (0.4, 0.6, 0), (1, 1, 0), (0, 1, 0)", square[:-11], ", ".join(["(1, 1, 1)"] * 4)]
    text = "\n".join(
        f"""def Mesh "mesh_{i}" {{
            uniform token subdivisionScheme = "none"
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [{points}]
        }}"""
        for i, points in enumerate(every)
    )
    description, found = translate_text(text)
    triangles = {shape.path: shape.triangles.tolist() for shape in description.shapes if isinstance(shape, Mesh)}
    fan = [[0, 1, 2], [0, 2, 3]]
    assert triangles == {"/mesh_0": fan, "/mesh_1": fan, "/mesh_2": [[1, 2, 3], [1, 3, 0]]}
    first, second, *_ = description.shapes
    assert isinstance(first, Mesh)
    assert isinstance(second, Mesh)
    assert first.points is second.points
    codes = [(code, path) for code, path in found if path.startswith("/mesh")]
    assert codes == [("faces-dropped", "/mesh_3"), ("faces-degenerate", "/mesh_4")]
