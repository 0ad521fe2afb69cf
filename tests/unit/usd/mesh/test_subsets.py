"""Subsets of faces have surfaces of their own."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.usd.mesh.mesh_text import QUADS

from primray.description import Mesh, SceneDescription

from ..usd_text import translate_text

SUBSETS = """
    def GeomSubset "quad" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        uniform token elementType = "face"
        uniform token familyName = "FAMILY"
        int[] indices = INDICES
        rel material:binding = </red>
    }
"""


RED = """def Material "red"
{
    token outputs:surface.connect = </red/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        INPUT
        token outputs:surface
    }
}
"""


def with_subset(
    family: str = "materialBind", indices: str = "[0]", extra: str = ""
) -> tuple[SceneDescription, list[tuple[str, str]]]:
    return translate_text(
        QUADS.replace("EXTRA", "").replace("BODY", SUBSETS.replace("FAMILY", family).replace("INDICES", indices))
        + RED.replace("INPUT", extra)
    )


@pytest.mark.conforms("GeomSubset.indices")
def test_subsets_give_surfaces_per_triangle() -> None:
    description, _ = with_subset()
    surfaces = np.asarray(description.shapes[0].surface)
    assert [description.surfaces[i].path for i in surfaces] == ["/red", "/red", ""]
    for family in ("", "look"):  # any family that binds a material
        description, found = with_subset(family=family)
        assert [description.surfaces[i].path for i in np.asarray(description.shapes[0].surface)] == ["/red", "/red", ""]
        assert "subset-ignored" not in {code for code, _ in found}
    assert ("subset-ignored", "/mesh/quad") in with_subset(indices="[9]")[1]


def test_a_subset_that_is_cut_out_leaves_a_hole() -> None:
    description, _ = with_subset(extra="float inputs:opacityThreshold = 0.5\n        float inputs:opacity = 0.2")
    shape = description.shapes[0]
    assert isinstance(shape, Mesh)
    assert shape.triangles.tolist() == [[1, 4, 2]]
    assert len(np.asarray(shape.surface)) == 1
