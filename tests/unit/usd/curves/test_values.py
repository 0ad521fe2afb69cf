"""Widths with vertex interpolation are control values of the basis: those may be negative, what comes of them may not."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pytest

import primray
from primray.description import Curves
from primray.settings import RenderSettings

from ..usd_text import stage_of, translate_text

BEZIER = np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 3, 0, 0], [1, 0, 0, 0]], float)
BSPLINE = np.array([[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 0, 3, 0], [1, 4, 1, 0]]) / 6
CATMULL_ROM = np.array([[-1, 3, -3, 1], [2, -5, 4, -1], [-1, 0, 1, 0], [0, 2, 0, 0]]) / 2
U = np.linspace(0, 1, 33)


@dataclass(frozen=True)
class Case:
    head: str
    basis: np.ndarray
    segments: list[list[int]]  # vertices of each


def cubic(basis: str, matrix: np.ndarray, segments: list[list[int]], more: str = "") -> Case:
    return Case(f'BasisCurves "c"\n{{\nuniform token basis = "{basis}"\n{more}', matrix, segments)


CASES = {
    "bezier": (cubic("bezier", BEZIER, [[0, 1, 2, 3]]), [0.4, -0.1, -0.1, 0.4]),
    "bezier of two": (cubic("bezier", BEZIER, [[0, 1, 2, 3], [3, 4, 5, 6]]), [0.4, -0.1, 0.2, 0.4, 0.5, -0.05, 0.3]),
    "bspline": (cubic("bspline", BSPLINE, [[0, 1, 2, 3], [1, 2, 3, 4]]), [-0.3, 0.5, -0.1, 0.6, -0.2]),
    "catmullRom": (cubic("catmullRom", CATMULL_ROM, [[0, 1, 2, 3], [1, 2, 3, 4]]), [-0.5, 0.4, 0.3, 0.4, -0.5]),
    "dipping catmullRom": (cubic("catmullRom", CATMULL_ROM, [[0, 1, 2, 3]]), [3.0, 0.5, 0.4, 0.1]),
    "nurbs": (
        Case('NurbsCurves "c"\n{\nint[] order = [4]\ndouble[] knots = [0, 0, 0, 0, 1, 1, 1, 1]', BEZIER, [[0, 1, 2, 3]]),
        [0.4, -0.1, -0.1, 0.4],
    ),
}


def text_of(case: Case, values: list[float], name: str = "widths", more: str = "") -> str:
    points = [(x, 0.2 * x * x, 0) for x in np.linspace(-1, 1, len(values)).tolist()]
    return (
        f"def {case.head}\nint[] curveVertexCounts = [{len(values)}]\npoint3f[] points = {points}\n"
        f'float[] {name} = {values} (interpolation = "vertex")\n{more}}}\n'
    )


def along(controls: np.ndarray) -> np.ndarray:
    """(S, 33) of cubic Bezier control values, four a segment that share their ends."""
    segments = [controls[k : k + 4] for k in range(0, len(controls) - 1, 3)]
    powers = np.stack([U**3, U**2, U, U**0], axis=1)
    return np.stack([powers @ BEZIER @ segment for segment in segments])


def expected(case: Case, values: list[float]) -> np.ndarray:
    powers = np.stack([U**3, U**2, U, U**0], axis=1)
    return np.stack([powers @ case.basis @ np.array(values)[vertices] / 2 for vertices in case.segments])


@pytest.mark.parametrize("name", ["widths", "primvars:widths"])
@pytest.mark.parametrize(("case", "values"), CASES.values(), ids=CASES)
def test_the_width_is_what_the_basis_makes_of_the_values(case: Case, values: list[float], name: str) -> None:
    wanted = expected(case, values)
    assert wanted.min() >= 0, "a case of widths that are none"
    description, codes = translate_text(text_of(case, values, name))
    (curves,) = description.shapes
    assert isinstance(curves, Curves)
    np.testing.assert_allclose(along(curves.controls[:, 3]), wanted, atol=1e-6)
    assert ("curve-widths", "/c") not in codes


@pytest.mark.parametrize(
    ("values", "segments"), [([0.4, -0.6, -0.6, 0.4], 1), ([0.4, -0.6, 0.2, -0.1, 0.2, 0.2, 0.2], 2), ([-1, -1, -1, -1], 1)]
)
def test_what_would_be_narrower_than_nothing_is_reported(values: list[float], segments: int) -> None:
    case = CASES["bezier"][0]
    text = text_of(case, values)
    from primray.usd import translate

    description, diagnostics = translate(stage_of(text), RenderSettings())
    (told,) = [d for d in diagnostics if d.code == "curve-widths"]
    assert f"{segments} segments" in told.message
    for curves in description.shapes:
        assert isinstance(curves, Curves)
        assert along(curves.controls[:, 3]).min() >= 0


def test_the_picture_is_that_of_the_same_widths_in_more_segments() -> None:
    """Halves of a segment, whose control values are all positive (de Casteljau)."""

    def halved(a: list[np.ndarray]) -> list[np.ndarray]:
        p01, p12, p23 = ((x + y) / 2 for x, y in itertools.pairwise(a))
        p012, p123 = (p01 + p12) / 2, (p12 + p23) / 2
        return [a[0], p01, p012, (p012 + p123) / 2, p123, p23, a[3]]

    points = [np.array((x, 0.2 * x * x, 0)) for x in (-1.0, -0.4, 0.4, 1.0)]
    widths = [np.array((w,)) for w in (0.8, -0.15, -0.15, 0.8)]
    eye = (
        'def Camera "eye"\n{\ntoken projection = "orthographic"\nfloat horizontalAperture = 24\nfloat verticalAperture = 18\n'
        'double3 xformOp:translate = (0, 0, 5)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
        'def DomeLight "sky"\n{\n}\n'
    )
    pictures = []
    for p, w in ((points, widths), (halved(points), halved(widths))):
        text = (
            f'{eye}def BasisCurves "c"\n{{\nuniform token basis = "bezier"\nint[] curveVertexCounts = [{len(p)}]\n'
            f"point3f[] points = {[tuple(x.tolist()) for x in p]}\n"
            f'float[] widths = {[float(x[0]) for x in w]} (interpolation = "vertex")\n}}\n'
        )
        picture = primray.render(stage_of(text), RenderSettings(resolution=(48, 36), spp=64, camera="/eye"))
        pictures.append(np.asarray(picture.pixels)[..., 3])
    assert 0.01 < pictures[1].mean() < 0.5
    assert np.abs(pictures[0] - pictures[1]).max() < 0.02
