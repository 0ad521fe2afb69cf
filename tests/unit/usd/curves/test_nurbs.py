"""NurbsCurves and HermiteCurves as Bezier segments, against their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from primray.description import Curves
from primray.usd.curves.bezier import CurveSet
from primray.usd.curves.nurbs import nurbs_curves

from ..usd_text import translate_text
from .test_bezier import point_at

HALF = 0.5**0.5
CIRCLE = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], np.float32)
CIRCLE_WEIGHTS = np.array([1, HALF, 1, HALF, 1, HALF, 1, HALF, 1])
CIRCLE_KNOTS = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], np.float64)


def made(order: int, knots: np.ndarray, points: np.ndarray, weights: np.ndarray | None = None, **more: object) -> CurveSet:
    counts = np.array([len(points)])
    ranges = more.get("ranges")
    return nurbs_curves(counts, points, np.ones(1, bool), np.array([order]), knots, ranges, weights)  # type: ignore[arg-type]


def de_boor(u: float, order: int, knots: np.ndarray, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """A point of the curve, by de Boor's algorithm on homogeneous points."""
    p = order - 1
    span = int(np.clip(np.searchsorted(knots, u, side="right") - 1, p, len(points) - 1))
    d = np.column_stack([points * weights[:, None], weights]).astype(np.float64)[span - p : span + 1]
    for r in range(1, p + 1):
        for j in range(p, r - 1, -1):
            i = span - p + j
            a = (u - knots[i]) / (knots[i + order - r] - knots[i])
            d[j] = (1 - a) * d[j - 1] + a * d[j]
    return d[p, :-1] / d[p, -1]


@pytest.mark.conforms("NurbsCurves.order", "NurbsCurves.knots", "NurbsCurves.pointWeights")
def test_a_rational_circle_is_a_circle() -> None:
    points = np.column_stack([CIRCLE, np.zeros(9)]).astype(np.float32)
    controls = made(3, CIRCLE_KNOTS, points, CIRCLE_WEIGHTS).controls(points).astype(np.float64)
    assert len(controls) % 3 == 1
    for k in range(0, len(controls) - 1, 3):
        for t in (0.0, 0.2, 0.5, 0.9):
            assert abs(np.linalg.norm(point_at(controls[k : k + 4], t)) - 1) < 2e-6


RANDOM = [(2, False), (3, False), (4, False), (4, True), (6, False), (6, True)]


@pytest.mark.parametrize(("order", "rational"), RANDOM)
def test_any_order_with_uneven_and_multiple_knots(order: int, rational: bool) -> None:
    rng = np.random.default_rng(order + rational)
    count = 12
    inner = np.sort(rng.uniform(0, 1, count - order))
    if order > 2:  # else it would be torn apart
        inner[3] = inner[2]
    knots = np.concatenate([np.zeros(order), inner, np.ones(order)])
    points = rng.normal(size=(count, 3)).astype(np.float32)
    weights = rng.uniform(0.3, 3, count) if rational else np.ones(count)
    curves = made(order, knots, points, weights if rational else None)
    controls = curves.controls(points).astype(np.float64)
    at = curves.ends + curves.within  # type: ignore[operator]
    domain = knots[order - 1 : count + 1]
    for s in range(int(curves.segments[0])):
        a, b = (float(np.interp(x, np.arange(len(domain)), domain)) for x in at[s : s + 2])
        for t in (0.0, 0.37, 0.99):
            u = a + (b - a) * t
            assert np.abs(point_at(controls[3 * s : 3 * s + 4], t) - de_boor(u, order, knots, points, weights)).max() < 1e-5


@pytest.mark.conforms("NurbsCurves.ranges")
def test_ranges_cut() -> None:
    points = np.column_stack([CIRCLE, np.zeros(9)]).astype(np.float32)
    ranges = np.array([[1.0, 2.0]])
    controls = made(3, CIRCLE_KNOTS, points, CIRCLE_WEIGHTS, ranges=ranges).controls(points)
    assert np.allclose(controls[[0, -1]], [(0, 1, 0), (-1, 0, 0)], atol=1e-6)


def test_a_knot_of_full_multiplicity_is_a_corner_or_tears_the_curve_apart() -> None:
    knots = np.array([0, 0, 0, 1, 1, 1, 2, 2, 2], np.float64)
    points = np.array([(0, 0, 0), (1, 1, 0), (2, 0, 0), (2, 0, 0), (3, 1, 0), (4, 0, 0)], np.float32)
    assert made(3, knots, points).segments.tolist() == [2]
    points[3] = (2, 1, 0)
    assert len(made(3, knots, points).drawn) == 0


@pytest.mark.parametrize(
    ("order", "knots"),
    [(1, [0, 1, 2, 3, 4]), (5, [0] * 9), (3, [0, 0, 0, 1, 1]), (3, [0, 0, 1, 0.5, 1, 1, 1]), (3, [0] * 7)],
)
def test_what_is_of_no_use_is_left_out(order: int, knots: list[float]) -> None:
    points = np.random.default_rng(0).normal(size=(4, 3)).astype(np.float32)
    assert len(made(order, np.array(knots, np.float64), points).drawn) == 0


NURBS = """def NurbsCurves "c"
{
    int[] curveVertexCounts = [3, 4]
    int[] order = [3, 4]
    double[] knots = [0, 0, 0, 1, 1, 1, 0, 0, 0, 0, 2, 2, 2, 2]
    point3f[] points = [(0, 0, 0), (1, 1, 0), (2, 0, 0), (0, 0, 1), (1, 0, 1), (2, 0, 1), (3, 0, 1)]
    MORE
}
"""


@pytest.mark.parametrize(
    ("widths", "expected"),
    [
        ("[2] (interpolation = 'constant')", [1] * 8),
        ("[2, 4] (interpolation = 'uniform')", [1] * 4 + [2] * 4),
        ("[2, 8, 2, 8] (interpolation = 'varying')", [1, 2, 3, 4, 1, 2, 3, 4]),
        ("[0, 6, 0, 2, 4, 6, 8] (interpolation = 'vertex')", [0, 2, 2, 0, 1, 2, 3, 4]),
    ],
)
def test_widths_of_nurbs(widths: str, expected: list[float]) -> None:
    description, diagnostics = translate_text(NURBS.replace("MORE", f"float[] widths = {widths}"))
    (curves,) = description.shapes
    assert isinstance(curves, Curves)
    assert [code for code, _ in diagnostics if code not in ("camera-automatic", "default-light")] == []
    assert curves.segments.tolist() == [1, 1]
    assert np.allclose(curves.controls[:, 3], expected, atol=1e-6)
    assert np.allclose(curves.controls[:4, :3], [(0, 0, 0), (2 / 3, 2 / 3, 0), (4 / 3, 2 / 3, 0), (2, 0, 0)], atol=1e-6)


def test_weights_that_do_not_fit_are_told() -> None:
    _, diagnostics = translate_text(NURBS.replace("MORE", "float[] widths = [1]\ndouble[] pointWeights = [1, 2]"))
    assert "invalid-primvar" in [code for code, _ in diagnostics]


HERMITE = """def HermiteCurves "c"
{
    int[] curveVertexCounts = [3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    vector3f[] tangents = TANGENTS
    float[] widths = [0.2, 0.4, 0.2] (
        interpolation = "varying"
    )
}
"""


@pytest.mark.conforms("HermiteCurves.tangents")
def test_hermite_curves_have_their_tangents() -> None:
    description, _ = translate_text(HERMITE.replace("TANGENTS", "[(3, 0, 0), (0, 3, 0), (0, 6, 0)]"))
    (curves,) = description.shapes
    assert isinstance(curves, Curves)
    expected = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, 0, 0), (1, 1, 0), (1, -1, 0), (1, 1, 0)]
    assert np.allclose(curves.controls[:, :3], expected, atol=1e-6)
    assert np.allclose(curves.controls[:, 3], [0.1, 0.4 / 3, 0.5 / 3, 0.2, 0.5 / 3, 0.4 / 3, 0.1], atol=1e-6)


def test_tangents_that_do_not_fit_are_told() -> None:
    description, diagnostics = translate_text(HERMITE.replace("TANGENTS", "[(3, 0, 0)]"))
    assert description.shapes == ()
    assert ("invalid-curves", "/c") in diagnostics
