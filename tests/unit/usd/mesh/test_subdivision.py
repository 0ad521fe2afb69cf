"""UsdGeomMesh with a subdivision scheme: what its cage becomes, and what is said of what does not fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from primray import core
from primray.description import Interpolation, PrimvarInput, SubdivisionMesh, Surface
from primray.settings import RenderSettings
from primray.usd.mesh.subdivision import cage_primvars

from ..usd_text import stage_of, translate_text
from .resolved_cage import resolved_cage

CUBE = """def Mesh "cube" {
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    point3f[] points = [(-1,-1,-1), (-1,-1,1), (-1,1,-1), (-1,1,1), (1,-1,-1), (1,-1,1), (1,1,-1), (1,1,1)]
    BODY
}"""


def cube(body: str = "", expected: tuple[str, ...] = ()) -> SubdivisionMesh:
    return only(CUBE.replace("BODY", body), expected)


def only(text: str, expected: tuple[str, ...] = ()) -> SubdivisionMesh:
    """The one cage of a stage, which dices to finite triangles."""
    description, found = translate_text(text, RenderSettings(resolution=(64, 64)))
    assert sorted(code for code, _ in found if code not in ("default-light", "camera-automatic")) == sorted(expected)
    (shape,) = description.shapes
    assert isinstance(shape, SubdivisionMesh)
    (mesh,) = core.dice(description, RenderSettings(resolution=(64, 64)))[0].shapes
    assert np.isfinite(mesh.points).all()  # type: ignore[union-attr]
    return shape


def mesh_text(counts: list[int], indices: list[int], body: str = "") -> str:
    points = ", ".join(f"({k % 3}, {k // 3}, {k % 2})" for k in range(9))
    return f"""def Mesh "m" {{
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {indices}
    point3f[] points = [{points}]
    {body}
}}"""


def test_defaults_are_usds() -> None:
    shape = cube()
    assert (shape.scheme, shape.interpolate_boundary) == ("catmullClark", "edgeAndCorner")
    assert (shape.face_varying_interpolation, shape.triangle_rule) == ("cornersPlus1", "catmullClark")
    assert shape.face_counts.tolist() == [4] * 6


def test_rules_are_read() -> None:
    body = """uniform token interpolateBoundary = "edgeOnly"
    uniform token faceVaryingLinearInterpolation = "boundaries"
    uniform token triangleSubdivisionRule = "smooth"
    uniform token subdivisionScheme = "bilinear"
    int[] holeIndices = [2, 2]
    int[] creaseIndices = [0, 1, 3, 0, 4]
    int[] creaseLengths = [3, 2]
    float[] creaseSharpnesses = [1.5, 12]
    int[] cornerIndices = [7]
    float[] cornerSharpnesses = [3]"""
    shape = cube(body.replace("\n", "\n    "))
    assert (shape.scheme, shape.interpolate_boundary) == ("bilinear", "edgeOnly")
    assert (shape.face_varying_interpolation, shape.triangle_rule) == ("boundaries", "smooth")
    assert shape.holes is not None
    assert shape.holes.tolist() == [2]
    assert shape.crease_lengths is not None
    assert shape.crease_sharpnesses is not None
    assert shape.crease_lengths.tolist() == [3, 2]
    assert shape.crease_sharpnesses.tolist() == [1.5, 10]
    assert shape.corner_points is not None
    assert shape.corner_points.tolist() == [7]


BAD_DATA = {
    "unknown rule": 'uniform token interpolateBoundary = "round"',
    "unknown scheme": 'uniform token subdivisionScheme = "butterfly"',
    "loop of quads": 'uniform token subdivisionScheme = "loop"',
    "creases too long": "int[] creaseIndices = [0, 1]\n int[] creaseLengths = [3]\n float[] creaseSharpnesses = [1]",
    "crease of one": "int[] creaseIndices = [0]\n int[] creaseLengths = [1]\n float[] creaseSharpnesses = [1]",
    "creases outside": "int[] creaseIndices = [0, 8]\n int[] creaseLengths = [2]\n float[] creaseSharpnesses = [1]",
    "sharpnesses missing": "int[] creaseIndices = [0, 1]\n int[] creaseLengths = [2]",
    "sharpnesses too many": "int[] creaseIndices = [0, 1]\n int[] creaseLengths = [2]\n float[] creaseSharpnesses = [1, 2, 3]",
    "corners outside": "int[] cornerIndices = [-1]\n float[] cornerSharpnesses = [1]",
    "corners of another length": "int[] cornerIndices = [0, 1]\n float[] cornerSharpnesses = [1]",
    "corners that are not numbers": "int[] cornerIndices = [0]\n float[] cornerSharpnesses = [nan]",
}


@pytest.mark.parametrize("name", BAD_DATA)
def test_data_that_does_not_fit(name: str) -> None:
    shape = cube(BAD_DATA[name], ("subdivision-data",))
    assert shape.scheme == "catmullClark"
    assert shape.crease_points is None


def test_holes_outside() -> None:
    shape = cube("int[] holeIndices = [1, 6, -2]", ("invalid-primvar",))
    assert shape.holes is not None
    assert shape.holes.tolist() == [1]


@pytest.mark.conforms("Gprim.orientation")
def test_left_handed_faces_turn_with_their_corners() -> None:
    right = cube('int[] primvars:displayColor:indices = [0]\n uniform token orientation = "rightHanded"')
    values = ", ".join(f"({k / 32}, 0, 0)" for k in range(24))
    colors = f'color3f[] primvars:displayColor = [{values}] (interpolation = "faceVarying")'
    left = cube(f'uniform token orientation = "leftHanded"\n {colors}')
    assert left.face_points.reshape(-1, 4)[:, [0, 3, 2, 1]].tolist() == right.face_points.reshape(-1, 4).tolist()
    assert left.colors is not None
    assert left.colors.indices is not None
    assert (32 * left.colors.values[left.colors.indices, 0]).tolist()[:8] == [0, 3, 2, 1, 4, 7, 6, 5]


def test_repeated_vertices_make_smaller_faces() -> None:
    """A quad with a vertex twice in a row is a triangle; where it comes back later the face goes."""
    values = ", ".join(f"({k / 32}, 0, 0)" for k in range(12))
    body = f'color3f[] primvars:displayColor = [{values}] (interpolation = "faceVarying")'
    shape = only(mesh_text([4, 4, 4], [0, 1, 1, 4, 0, 4, 5, 3, 3, 4, 3, 7], body), ("faces-degenerate",))
    assert shape.face_counts.tolist() == [3, 4]
    assert shape.face_points.tolist() == [0, 1, 4, 0, 4, 5, 3]
    assert shape.colors is not None
    assert shape.colors.indices is not None
    assert shape.colors.indices.tolist() == [0, 2, 3, 4, 5, 6, 7]


def test_unusable_faces_are_dropped_and_renumbered() -> None:
    body = (
        'int[] holeIndices = [2]\n color3f[] primvars:displayColor = [(.1,0,0), (.2,0,0), (.5,0,0)] (interpolation = "uniform")'
    )
    shape = only(mesh_text([4, 4, 4], [0, 1, 4, 3, 0, 1, 99, 3, 1, 2, 5, 4], body), ("faces-dropped",))
    assert shape.face_counts.tolist() == [4, 4]
    assert shape.holes is not None
    assert shape.holes.tolist() == [1]
    assert shape.colors is not None
    assert shape.colors.values[:, 0].tolist() == pytest.approx([0.1, 0.5])


def test_nothing_left() -> None:
    description, found = translate_text(mesh_text([4], [0, 1, 0, 1]))
    assert description.shapes == ()
    assert ("faces-degenerate", "/m") in found


@pytest.mark.parametrize(
    ("usd", "number", "kind"),
    [
        ("uniform", 6, Interpolation.FACE),
        ("vertex", 8, Interpolation.POINT),
        ("varying", 8, Interpolation.VARYING),
        ("faceVarying", 24, Interpolation.CORNER),
    ],
)
def test_display_color(usd: str, number: int, kind: Interpolation) -> None:
    values = ", ".join(f"({k / 32}, 0, 0)" for k in range(number))
    shape = cube(f'color3f[] primvars:displayColor = [{values}] (interpolation = "{usd}")')
    assert shape.colors is not None
    assert shape.colors.interpolation is kind
    rows = shape.colors.values if shape.colors.indices is None else shape.colors.values[shape.colors.indices]
    assert (32 * rows[:, 0]).tolist() == list(range(number))
    wrong = cube(f'color3f[] primvars:displayColor = [(1, 1, 1), (0, 0, 0)] (interpolation = "{usd}")', ("invalid-primvar",))
    assert wrong.colors is None


def test_indexed_face_varying_keeps_its_indices() -> None:
    shape = cube(
        f'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "faceVarying")\n'
        f"int[] primvars:displayColor:indices = {[k % 2 for k in range(24)]}"
    )
    assert shape.colors is not None
    assert shape.colors.indices is not None
    assert len(shape.colors.values) == 2
    assert shape.colors.indices.tolist() == [k % 2 for k in range(24)]


def test_normals_do_not_count() -> None:
    cube("normal3f[] normals = [(1, 0, 0)]")


SUBSETS = """
    color3f[] primvars:displayColor = [VALUES] (interpolation = "INTERPOLATION")
    uniform token subsetFamily:materialBind:familyType = "nonOverlapping"
    def GeomSubset "part" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token familyName = "materialBind"
        int[] indices = [0, 5]
        rel material:binding = </red>
    }"""
RED = """
def Material "red" {
    token outputs:surface.connect = </red/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.9, 0, 0)
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize(("usd", "number"), [("uniform", 6), ("vertex", 8), ("faceVarying", 24)])
def test_subsets(usd: str, number: int) -> None:
    values = ", ".join("(0.25, 0.5, 0.75)" for _ in range(number))
    body = SUBSETS.replace("VALUES", values).replace("INTERPOLATION", usd)
    shape = only(RED + CUBE.replace("BODY", body))
    assert isinstance(shape.surface, np.ndarray)
    assert len(set(shape.surface[[0, 5]].tolist())) == 1
    assert len(set(shape.surface[1:5].tolist())) == 1
    assert shape.surface[0] != shape.surface[1]
    colors: Any = shape.colors
    rows = colors.values if colors.indices is None else colors.values[colors.indices]
    of_face = rows if len(rows) == 6 else rows.reshape(6, 4, 3)[:, 0]
    np.testing.assert_array_equal(of_face[[0, 5]], 1.0)
    np.testing.assert_array_equal(of_face[1:5], [[0.25, 0.5, 0.75]] * 4)


def test_non_manifold_edges_are_said_while_dicing() -> None:
    text = mesh_text([4, 4, 4], [0, 1, 4, 3, 1, 0, 6, 7, 0, 1, 8, 5])
    description, found = translate_text(text, RenderSettings(resolution=(64, 64)))
    assert "cage-topology" not in {code for code, _ in found}
    _, warnings = core.dice(description, RenderSettings(resolution=(64, 64)))
    assert [(code, path) for code, path, _ in warnings] == [("cage-topology", "/m")]


def test_unknown_creases_are_said() -> None:
    body = "int[] creaseIndices = [0, 7]\n int[] creaseLengths = [2]\n float[] creaseSharpnesses = [1]"
    description, _ = translate_text(CUBE.replace("BODY", body))
    _, warnings = core.dice(description, RenderSettings())
    assert [code for code, _, _ in warnings] == ["cage-topology"]


ST = """texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
    int[] primvars:st:indices = [INDICES]
    float[] primvars:weight = [0, 1, 2, 3, 4, 5, 6, 7] (interpolation = "varying")
    int[] primvars:id = [4] (interpolation = "constant")
    string[] primvars:label = ["a"] (interpolation = "constant")
    double primvars:single = 2.5 (interpolation = "constant")"""


def test_primvars_by_name() -> None:
    indices = [(3 * k) % 4 for k in range(24)]
    stage = stage_of(CUBE.replace("BODY", ST.replace("INDICES", ", ".join(map(str, indices)))))
    resolved, found_cage, ctx = resolved_cage(stage, "/cube")
    names = {"st": 2, "absent": 1, "weight": 1, "id": 1, "single": 1, "label": 1}
    reads = Surface("", inputs=tuple((n, PrimvarInput(n, (0.0,) * width)) for n, width in names.items()))
    st, weight, number, single = cage_primvars(resolved, [reads], found_cage, ctx)
    assert st.indices is not None
    assert (st.name, st.interpolation, st.values.shape, st.indices.tolist()) == ("st", Interpolation.CORNER, (4, 2), indices)
    assert (weight.interpolation, weight.values.tolist()) == (Interpolation.VARYING, [[k] for k in range(8)])
    assert (number.interpolation, number.values.tolist()) == (Interpolation.CONSTANT, [[4]])
    assert single.values.tolist() == [[2.5]]
    assert [d.code for d in ctx.diagnostics] == ["primvar-missing", "invalid-primvar", "primvar-missing"]  # absent, the label
