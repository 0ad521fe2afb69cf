"""GeomSubsets of curves: pairs of a curve and a segment of it."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description import Curves, SceneDescription

from ..usd_text import translate_text

STAGE = """def BasisCurves "c" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    uniform token type = "linear"
    int[] curveVertexCounts = [3, 1, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (9, 9, 9), (0, 1, 0), (1, 1, 0), (2, 1, 0), (3, 1, 0)]
    float[] widths = [0.1]
    def GeomSubset "s" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        uniform token elementType = "ELEMENT"
        uniform token familyName = "materialBind"
        int[] indices = INDICES
        rel material:binding = </red>
    }
}
def Material "red"
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


def made(indices: str, element: str = "segment") -> tuple[SceneDescription, Curves, list[str]]:
    description, diagnostics = translate_text(STAGE.replace("INDICES", indices).replace("ELEMENT", element))
    (shape,) = description.shapes
    assert isinstance(shape, Curves)
    return description, shape, [code for code, _ in diagnostics]


@pytest.mark.conforms("GeomSubset.elementType")
def test_segments_have_their_material() -> None:
    description, shape, codes = made("[0, 1, 2, 0, 2, 2]")
    red = [k for k, s in enumerate(description.surfaces) if s.path == "/red"]
    assert isinstance(shape.surface, np.ndarray)
    assert [n in red for n in shape.surface.tolist()] == [False, True, True, False, True]
    assert "subset-ignored" not in codes


@pytest.mark.parametrize(
    ("indices", "element"), [("[0]", "segment"), ("[3, 0]", "segment"), ("[0, 2]", "segment"), ("[0, 1]", "face")]
)
def test_what_names_no_segments_is_told(indices: str, element: str) -> None:
    _, shape, codes = made(indices, element)
    assert "subset-ignored" in codes
    assert isinstance(shape.surface, int) or len(set(shape.surface.tolist())) == 1
