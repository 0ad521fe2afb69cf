"""Curves of a stage: widths and primvars of every interpolation, what does not fit, and what is told."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description import Curves, Interpolation
from primray.usd.curves.values import THIN

from ..usd_text import translate_text

STAGE = """def BasisCurves "c"
{
    uniform token type = "cubic"
    uniform token basis = "bspline"
    int[] curveVertexCounts = [5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 1, 0), (3, 0, 0), (4, 0, 0), (0, 5, 0), (1, 5, 0), (2, 5, 1), (3, 5, 0)]
    MORE
}
"""
QUIET = {"camera-automatic", "default-light"}


def translated(more: str, text: str = STAGE) -> tuple[list[Curves], list[str]]:
    description, diagnostics = translate_text(text.replace("MORE", more))
    assert all(isinstance(shape, Curves) for shape in description.shapes)
    return list(description.shapes), [code for code, _ in diagnostics if code not in QUIET]  # type: ignore[arg-type]


def widths(values: list[float], interpolation: str, name: str = "widths") -> str:
    return f"float[] {name} = {values} (\n interpolation = '{interpolation}'\n)"


@pytest.mark.conforms("Curves.widths")
@pytest.mark.parametrize(
    ("interpolation", "values", "expected"),
    [
        ("constant", [2], [1] * 11),
        ("uniform", [2, 4], [1] * 7 + [2] * 4),
        ("varying", [2, 8, 2, 4, 10], [1, 2, 3, 4, 3, 2, 1, 2, 3, 4, 5]),
        ("vertex", [2] * 5 + [0, 6, 12, 18], [1] * 7 + [3, 4, 5, 6]),
    ],
)
def test_widths(interpolation: str, values: list[float], expected: list[float]) -> None:
    (curves,), codes = translated(widths(values, interpolation))
    assert np.allclose(curves.controls[:, 3], expected, atol=1e-6)
    assert codes == []


def test_primvars_widths_win_and_may_be_indexed() -> None:
    more = widths([2], "constant") + "\n" + widths([4, 6], "uniform", "primvars:widths")
    (curves,), _ = translated(more + "\nint[] primvars:widths:indices = [1, 0]")
    assert curves.controls[:, 3].tolist() == [3] * 7 + [2] * 4


def test_one_width_stands_for_all_whatever_its_interpolation() -> None:
    (curves,), codes = translated("float[] widths = [2]")
    assert set(curves.controls[:, 3].tolist()) == {1.0}
    assert codes == []


@pytest.mark.parametrize("values", [[1, 2, 3], [float("nan")] * 3])
def test_widths_that_do_not_fit_are_told_and_their_mean_is_used(values: list[float]) -> None:
    shapes, codes = translated(widths(values, "vertex"))
    assert codes == ["curve-widths"]
    assert [set(s.controls[:, 3].tolist()) for s in shapes] == ([{1.0}] if values[0] == 1 else [])


def test_widths_that_fit_another_interpolation_are_read_so() -> None:
    (curves,), codes = translated(widths([2, 8, 2, 4, 10], "vertex"))
    assert codes == ["curve-widths"]
    assert curves.controls[3, 3] == 4


def test_negative_widths_are_none() -> None:
    (curves,), codes = translated(widths([2, -4], "uniform"))
    assert codes == ["curve-widths"]
    assert curves.controls[:, 3].tolist() == [1] * 7 + [0] * 4


def test_zero_widths_draw_nothing() -> None:
    assert translated(widths([0], "constant")) == ([], [])


def test_curves_without_widths_are_thin_lines_and_told() -> None:
    """No tubes of a unit: debug lines, tool paths and guides have none."""
    (curves,), codes = translated("")
    span = np.linalg.norm([4, 5, 1])
    assert np.allclose(curves.controls[:, 3], THIN * span / 2)
    assert codes == ["curve-widths"]
    (small,), _ = translated("", STAGE.replace("(0, 5, 0)", "(0, 5000, 0)"))
    assert small.controls[0, 3] == 0.5  # and never wider than Storm draws them


COLORS = {
    "uniform": (2, Interpolation.FACE),
    "varying": (5, Interpolation.CORNER),
    "vertex": (9, Interpolation.POINT),
}


@pytest.mark.conforms("Gprim.primvars:displayColor", state="honoured")
@pytest.mark.parametrize("interpolation", COLORS)
def test_colours_vary_over_curves(interpolation: str) -> None:
    count, kind = COLORS[interpolation]
    colors = [(round(k / count, 3), 0.5, 0) for k in range(count)]
    more = f"color3f[] primvars:displayColor = {colors} (\n interpolation = '{interpolation}'\n)\nfloat[] widths = [0.1]"
    description, _ = translate_text(STAGE.replace("MORE", more))
    (shape,) = description.shapes
    assert isinstance(shape, Curves)
    (primvar,) = shape.primvars
    assert primvar.interpolation is kind
    assert len(primvar.values) == {Interpolation.FACE: 2, Interpolation.CORNER: 5, Interpolation.POINT: 11}[kind]
    (surface,) = description.surfaces
    assert [name for name, _ in surface.inputs] == ["diffuse_color"]
    assert np.allclose(primvar.values[-1], colors[-1] if kind is not Interpolation.POINT else [7 / 9, 0.5, 0], atol=2e-3)


def test_counts_that_do_not_fit_are_told_and_the_rest_drawn() -> None:
    text = STAGE.replace('"bspline"', '"bezier"')
    (curves,), codes = translated("float[] widths = [0.1]", text)
    assert codes == ["invalid-curves"]
    assert curves.segments.tolist() == [1]
    assert curves.controls[0, 1] == 5


def test_points_that_are_not_finite_take_their_curve_along() -> None:
    (curves,), codes = translated("float[] widths = [0.1]", STAGE.replace("(2, 1, 0)", "(inf, 1, 0)"))
    assert codes == ["invalid-curves"]
    assert curves.segments.tolist() == [1]


@pytest.mark.parametrize(("attribute", "value"), [("type", "spline"), ("basis", "hermite"), ("wrap", "around")])
def test_unknown_tokens_are_told(attribute: str, value: str) -> None:
    text = STAGE.replace('uniform token type = "cubic"', "").replace("5, 4]", "4, 4]").replace("(4, 0, 0), ", "")
    text = text.replace('    uniform token basis = "bspline"\n', "") if attribute == "basis" else text
    (curves,), codes = translated(f'float[] widths = [0.1]\nuniform token {attribute} = "{value}"', text)
    assert codes == ["invalid-curves"]
    assert len(curves.segments) == 2


@pytest.mark.parametrize("missing", ["int[] curveVertexCounts = [5, 4]", "point3f[] points"])
def test_curves_without_counts_or_points_are_told(missing: str) -> None:
    text = "\n".join(line for line in STAGE.splitlines() if missing not in line)
    assert translated("float[] widths = [0.1]", text) == ([], ["invalid-curves"])


def test_nothing_authored_is_nothing() -> None:
    assert translated("", 'def BasisCurves "c"\n{\n}\n') == ([], ["invalid-curves"])


GLOWING = """def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        INPUT
        token outputs:surface
    }
}
"""
BOUND = STAGE.replace('"c"\n', '"c" (prepend apiSchemas = ["MaterialBindingAPI"])\n')
BOUND = BOUND.replace("MORE", "rel material:binding = </m>\nMORE")


def test_light_of_tubes_is_told() -> None:
    text = BOUND + GLOWING.replace("INPUT", "color3f inputs:emissiveColor = (1, 1, 1)")
    assert translated("float[] widths = [0.1]", text)[1] == ["curve-lights"]
    normals = "float[] widths = [0.1]\nnormal3f[] normals = [(0, 0, 1)] (\n interpolation = 'constant'\n)"
    _, diagnostics = translate_text(text.replace("MORE", normals))
    assert "curve-lights" not in [code for code, _ in diagnostics]


@pytest.mark.parametrize("kind", ["invisible", "guide"])
def test_what_is_not_asked_for_is_not_drawn(kind: str) -> None:
    more = 'token visibility = "invisible"' if kind == "invisible" else 'uniform token purpose = "guide"'
    assert translated("float[] widths = [0.1]\n" + more) == ([], [])
