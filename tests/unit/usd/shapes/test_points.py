"""Points as spheres: where they are, how wide, of what colour; and what is left out."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description import Placement, PrimvarInput, SceneDescription, Sphere
from primray.description.placement import chunks

from ..usd_text import translate_text

POINTS = """
def Xform "up"
{
    double3 xformOp:translate = (0, 5, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Points "p"
    {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
        MORE
    }
}
"""


def rows_of(placement: Placement) -> np.ndarray:
    """(K, 3, 4)."""
    return np.concatenate(list(chunks(placement.levels)))


def placed(more: str) -> tuple[SceneDescription, dict[tuple[float, float, float], float], list[str]]:
    """The description, centre to radius of every sphere, and the diagnostics."""
    description, diagnostics = translate_text(POINTS.replace("MORE", more))
    assert all(isinstance(shape, Sphere) and shape.radius == 1 for shape in description.shapes)
    matrices = [p.matrix[:3] for p in description.static]
    for placement in description.placements:
        (inner,) = description.prototypes[placement.prototype].shapes
        assert (inner.matrix == np.eye(4)).all()
        matrices += list(rows_of(placement))
    return description, {tuple(m[:, 3].tolist()): float(m[0, 0]) for m in matrices}, [code for code, _ in diagnostics]


@pytest.mark.conforms("Points.widths")
def test_widths_are_diameters() -> None:
    description, found, codes = placed("float[] widths = [1, 2, 3]")
    assert found == {(0, 5, 0): 0.5, (1, 5, 0): 1.0, (2, 5, 0): 1.5}
    assert len(description.shapes) == 1
    assert "points" in codes


@pytest.mark.parametrize(
    ("widths", "radius"),
    [
        ("", 0.5),
        ("float[] widths = [4] (\n interpolation = 'constant'\n)", 2.0),
        ("float[] widths = [4]\nfloat[] primvars:widths = [6]", 3.0),
        ("float[] widths = [4, 5]", 0.5),
    ],
)
@pytest.mark.conforms("Points.widths")
def test_one_width_for_all(widths: str, radius: float) -> None:
    _, found, codes = placed(widths)
    assert set(found.values()) == {radius}
    assert ("invalid-primvar" in codes) == ("[4, 5]" in widths)


def test_points_without_width_or_place_are_left_out_and_told() -> None:
    _, found, codes = placed("float[] widths = [0, 2, nan]")
    assert found == {(1, 5, 0): 1.0}
    assert "invalid-primvar" in codes


def test_colours_by_point() -> None:
    description, found, _ = placed(
        "color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (\n interpolation = 'vertex'\n)\n"
        "int[] primvars:displayColor:indices = [1, 0, 1]"
    )
    assert len(found) == 3
    assert dict(description.surfaces[0].inputs) == {"diffuse_color": PrimvarInput("displayColor", (0.18, 0.18, 0.18))}
    assert values_by_x(description) == {0: (0, 1, 0), 1: (1, 0, 0), 2: (0, 1, 0)}


def values_by_x(description: SceneDescription) -> dict[float, tuple[float, ...]]:
    """Of the only primvar that varies over the points."""
    found: dict[float, tuple[float, ...]] = {}
    for placement in description.placements:
        [varying] = placement.primvars
        found |= dict(zip(rows_of(placement)[:, 0, 3].tolist(), map(tuple, varying.values.tolist()), strict=True))
    return found


MATERIAL = """
def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor.connect = </m/r.outputs:result>
        token outputs:surface
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        token inputs:varname = "glow"
        float3 outputs:result
    }
}
"""


def test_what_a_material_reads_of_points() -> None:
    """Left out points take theirs along; a constant value is the sphere's."""
    points = POINTS.replace('"p"', '"p" (prepend apiSchemas = ["MaterialBindingAPI"])')
    for values, shape, placed_ in (
        ("[(1, 0, 0), (2, 0, 0), (3, 0, 0)] (interpolation = 'vertex')", [], {0: (1, 0, 0), 2: (3, 0, 0)}),
        ("[(4, 0, 0)]", [[[4, 0, 0]]], None),
    ):
        more = f"rel material:binding = </m>\nfloat[] widths = [1, 0, 1]\ncolor3f[] primvars:glow = {values}"
        description, _ = translate_text(MATERIAL + points.replace("MORE", more))
        [sphere] = description.shapes
        assert [p.values.tolist() for p in sphere.primvars] == shape
        assert placed_ is None or values_by_x(description) == placed_


def test_a_constant_colour_and_a_hidden_purpose() -> None:
    description, _, _ = placed("color3f[] primvars:displayColor = [(0.25, 0.5, 1)]")
    assert description.surfaces[0].diffuse_color == (0.25, 0.5, 1)
    assert placed('uniform token purpose = "guide"')[1] == {}


def test_many_colours_are_kept() -> None:
    rng = np.random.default_rng(1)
    values = ", ".join(f"({r:.4f}, {g:.4f}, {b:.4f})" for r, g, b in rng.random((300, 3)))
    points = ", ".join(f"({k}, 0, 0)" for k in range(300))
    color = f"color3f[] primvars:displayColor = [{values}] (\ninterpolation = 'vertex'\n)"
    description, _ = translate_text(f'def Points "p"\n{{\npoint3f[] points = [{points}]\n{color}\n}}\n')
    assert len(description.shapes) == 1
    assert len(set(values_by_x(description).values())) == 300
