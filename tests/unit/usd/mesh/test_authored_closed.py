"""Closed shapes that light enters are reported where they are inside out, whatever says so; all others are not."""

from __future__ import annotations

import pytest

from ..usd_text import translate_text

FACES = ["0, 3, 2, 1", "4, 5, 6, 7", "0, 1, 5, 4", "1, 2, 6, 5", "2, 3, 7, 6", "3, 0, 4, 7"]
POINTS = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
GLASS = """def Material "glass"
{
    token outputs:mtlx:surface.connect = </glass/s.outputs:out>
    def Shader "s"
    {
        uniform token info:id = "ND_open_pbr_surface_surfaceshader"
        INPUTS
        token outputs:out
    }
}
"""
CLEAR = "float inputs:transmission_weight = 1\nfloat inputs:transmission_depth = 1"


def box(*, turned: bool = False, more: str = "", scheme: str = "none", shift: float = 0.0) -> str:
    faces = [", ".join(face.split(", ")[::-1]) for face in FACES] if turned else FACES
    points = [(x + shift, y, z) for x, y, z in POINTS]
    return f"""def Mesh "box" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [{", ".join(faces)}]
    point3f[] points = {points}
    uniform token subdivisionScheme = "{scheme}"
    rel material:binding = </glass>
    {more}
}}
"""


def reported(text: str, inputs: str = CLEAR) -> bool:
    return ("inside-out", "/box") in translate_text(text + GLASS.replace("INPUTS", inputs))[1]


LEFT = 'uniform token orientation = "leftHanded"'
MIRROR = 'double3 xformOp:scale = (-1, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
SUBSET = """def GeomSubset "top" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    uniform token elementType = "face"
    uniform token familyName = "materialBind"
    int[] indices = [1]
    rel material:binding = </glass>
}"""


@pytest.mark.parametrize("shift", [0.0, 50.0], ids=["around the origin", "away from it"])
@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
@pytest.mark.parametrize("more", ["", MIRROR, SUBSET], ids=["plain", "mirrored", "subsets"])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("left", ["", LEFT], ids=["right-handed", "left-handed"])
def test_winding_and_orientation_decide(left: str, turned: bool, more: str, scheme: str, shift: float) -> None:
    found = reported(box(turned=turned, more=f"{left}\n{more}", scheme=scheme, shift=shift))
    assert found == (turned != bool(left))


@pytest.mark.parametrize(
    "inputs", ["", "float inputs:transmission_weight = 1\nbool inputs:geometry_thin_walled = 1"], ids=["opaque", "thin"]
)
def test_what_has_no_inside_is_not(inputs: str) -> None:
    assert not reported(box(turned=True), inputs)


def test_open_meshes_are_not() -> None:
    open_box = box(turned=True).replace("[4, 4, 4, 4, 4, 4]", "[4, 4, 4, 4, 4]").replace(", 7, 4, 0, 3]", "]")
    assert "7, 4, 0, 3" not in open_box
    assert not reported(open_box)


def test_tetrahedra_that_say_so() -> None:
    tets = """def TetMesh "box" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    int4[] tetVertexIndices = [ORDER]
    rel material:binding = </glass>
}
"""
    assert not reported(tets.replace("ORDER", "(0, 1, 2, 3)"))
    assert reported(tets.replace("ORDER", "(0, 2, 1, 3)"))
