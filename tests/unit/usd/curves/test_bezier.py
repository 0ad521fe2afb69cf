"""Segments of BasisCurves by type, basis and wrap; the counts are those of the schema's own table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from primray.usd.curves import bezier
from primray.usd.curves.bezier import BEZIER, BSPLINE, CATMULL_ROM, CurveSet, basis_curves

TABLE = [
    ("linear", BEZIER, "nonperiodic", [2, 3, 2, 5], [1, 2, 1, 4], [2, 3, 2, 5]),
    ("cubic", BEZIER, "nonperiodic", [4, 7, 10, 4, 7], [1, 2, 3, 1, 2], [2, 3, 4, 2, 3]),
    ("cubic", BSPLINE, "nonperiodic", [5, 4, 6, 7], [2, 1, 3, 4], [3, 2, 4, 5]),
    ("cubic", BEZIER, "periodic", [6, 9, 6], [2, 3, 2], [2, 3, 2]),
    ("linear", BEZIER, "periodic", [3, 7], [3, 7], [3, 7]),
    # USD's helper gives 5, 0 and 10 here; the text's rules say otherwise.
    ("cubic", BSPLINE, "pinned", [7], [6], [7]),
    ("cubic", CATMULL_ROM, "pinned", [2], [1], [2]),
    ("cubic", BEZIER, "pinned", [7], [2], [3]),
]


def made(counts: list[int], kind: str, basis: str, wrap: str) -> CurveSet:
    return basis_curves(np.array(counts), sum(counts), np.ones(len(counts), bool), kind, basis, wrap)


@pytest.mark.conforms("BasisCurves.wrap")
@pytest.mark.conforms("Curves.curveVertexCounts")
@pytest.mark.parametrize(("kind", "basis", "wrap", "counts", "segments", "varying"), TABLE)
def test_counts(kind: str, basis: str, wrap: str, counts: list[int], segments: list[int], varying: list[int]) -> None:
    curves = made(counts, kind, basis, wrap)
    assert curves.segments.tolist() == segments
    assert curves.sizes.of("varying") == sum(varying)
    assert curves.sizes.of("vertex") == sum(counts)
    assert curves.sizes.of("uniform") == len(counts)
    ends = curves.ends.tolist()
    assert len(ends) == sum(segments) + len(segments)
    assert sorted(set(ends)) == list(range(sum(varying)))
    if wrap == "periodic":
        assert ends[segments[0]] == ends[0]


@pytest.mark.parametrize(
    ("kind", "basis", "wrap", "counts", "drawn"),
    [
        ("cubic", BEZIER, "nonperiodic", [4, 5, 7, 3], [0, 2]),
        ("cubic", BEZIER, "periodic", [3, 4, 6], [0, 2]),
        ("cubic", BSPLINE, "periodic", [3, 2, 4], [0, 2]),
        ("cubic", BSPLINE, "pinned", [1, 2], [1]),
        ("linear", BEZIER, "nonperiodic", [1, 2, 0], [1]),
        ("linear", BEZIER, "periodic", [2, 3], [1]),
    ],
)
def test_what_makes_no_segments_is_left_out(kind: str, basis: str, wrap: str, counts: list[int], drawn: list[int]) -> None:
    assert made(counts, kind, basis, wrap).drawn.tolist() == drawn


def test_curves_beyond_the_points_are_left_out() -> None:
    curves = basis_curves(np.array([2, 2, 2]), 5, np.ones(3, bool), "linear", BEZIER, "nonperiodic")
    assert curves.drawn.tolist() == [0, 1]


def point_at(controls: np.ndarray, u: float) -> np.ndarray:
    v = 1 - u
    return controls[0] * v**3 + 3 * controls[1] * u * v * v + 3 * controls[2] * u * u * v + controls[3] * u**3


@pytest.mark.parametrize("basis", [BEZIER, BSPLINE, CATMULL_ROM])
def test_a_segment_is_that_of_its_basis(basis: str) -> None:
    """By the basis functions as they are usually written, in powers of t."""
    powers = {
        BEZIER: np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 3, 0, 0], [1, 0, 0, 0]]),
        BSPLINE: np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 0, 3, 0], [1, 4, 1, 0]]) / 6,
        CATMULL_ROM: np.array([[-1, 3, -3, 1], [2, -5, 4, -1], [-1, 0, 1, 0], [0, 2, 0, 0]]) / 2,
    }
    points = np.random.default_rng(1).normal(size=(4, 3)).astype(np.float32)
    controls = made([4], "cubic", basis, "nonperiodic").controls(points)
    for t in (0.0, 0.3, 1.0):
        expected = np.array([t**3, t**2, t, 1]) @ powers[basis] @ points
        assert np.abs(point_at(controls.astype(np.float64), t) - expected).max() < 1e-6


@pytest.mark.parametrize("basis", [BSPLINE, CATMULL_ROM])
def test_pinned_curves_begin_and_end_at_their_points(basis: str) -> None:
    rng = np.random.default_rng(2)
    points = rng.normal(size=(7, 3)).astype(np.float32)
    controls = made([5, 2], "cubic", basis, "pinned").controls(points)
    assert np.allclose(controls[[0, 12]], points[[0, 4]], atol=1e-6)
    line = controls[13:]
    assert np.allclose(line[[0, 3]], points[5:], atol=1e-6)
    assert np.allclose(np.cross(line[1] - line[0], line[3] - line[0]), 0, atol=1e-6)


@pytest.mark.parametrize("basis", [BEZIER, BSPLINE, CATMULL_ROM])
def test_periodic_curves_close_without_a_corner(basis: str) -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(12, 3)).astype(np.float32)
    curves = made([3, 9], "cubic", basis, "periodic")
    controls = curves.controls(points)
    size = 3 * curves.segments + 1
    for loop in (controls[: size[0]], controls[size[0] :]):
        assert np.array_equal(loop[0], loop[-1])
        if basis != BEZIER:
            assert np.allclose(loop[1] - loop[0], loop[-1] - loop[-2], atol=1e-6)


def test_values_at_ends_are_linear_along_segments() -> None:
    curves = made([5, 4], "cubic", BSPLINE, "nonperiodic")
    ends = np.array([[0.0], [3.0], [0.0], [10.0], [13.0]], np.float32)
    assert curves.controls_of_ends(ends)[:, 0].tolist() == [0, 1, 2, 3, 2, 1, 0, 10, 11, 12, 13]


@pytest.mark.parametrize("own_weights", [False, True])
def test_blocks_do_not_show(monkeypatch: pytest.MonkeyPatch, own_weights: bool) -> None:
    curves = made([7, 4, 9], "cubic", BSPLINE, "nonperiodic")
    if own_weights:  # as NURBS curves have
        scales = np.linspace(1.0, 2.0, len(curves.corners))
        curves = replace(curves, to_bezier=curves.to_bezier * scales[:, None, None])
    values = np.random.default_rng(5).normal(size=(20, 3)).astype(np.float32)
    whole = curves.controls(values)
    monkeypatch.setattr(bezier, "BLOCK", 4)
    assert (curves.controls(values) == whole).all()
