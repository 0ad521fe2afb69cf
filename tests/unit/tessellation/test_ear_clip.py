"""Ear clipping: n - 2 triangles in the polygon's winding, with its area where it is simple."""

from __future__ import annotations

import math

import numpy as np
import pytest

from primray.arrays import Doubles
from primray.tessellation.ear_clip import ear_clip

L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
SPIKE = [(0, 0), (4, 0), (4, 2), (2, 2), (2, 3), (2, 2), (0, 2)]
COMB = [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (5, 1), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (0, 3)]
STAR = [(r * math.cos(k * math.pi / 7), r * math.sin(k * math.pi / 7)) for k in range(14) for r in [1.0 if k % 2 else 0.2]]
POLYGONS = {"L": L_SHAPE, "spike": SPIKE, "comb": COMB, "star": STAR}


def area_vector(points: Doubles, triangles: np.ndarray) -> Doubles:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas: Doubles = np.cross(b - a, c - a) / 2
    return areas


def polygon_area(points: Doubles) -> Doubles:
    area: Doubles = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2
    return area


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("name", POLYGONS)
def test_simple_polygons_keep_their_area_and_winding(name: str, reverse: bool, axis: int) -> None:
    plane = np.array(POLYGONS[name], np.float64)[:: -1 if reverse else 1]
    points = np.insert(plane, axis, 5.0, axis=1)
    triangles = ear_clip(points)
    assert triangles.shape == (len(points) - 2, 3)
    areas, whole = area_vector(points, triangles), polygon_area(points - points[0])
    np.testing.assert_allclose(areas.sum(axis=0), whole, atol=1e-12)
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(np.linalg.norm(whole))  # none overlaps another


@pytest.mark.parametrize("points", [[(0, 0), (1, 1), (1, 0), (0, 1)], [(0, 0), (1, 0), (2, 0), (3, 0)], [(1, 1)] * 5])
def test_polygons_that_cross_themselves_or_are_flat_have_triangles_too(points: list[tuple[float, float]]) -> None:
    triangles = ear_clip(np.insert(np.array(points, np.float64), 2, 0.0, axis=1))
    assert triangles.shape == (len(points) - 2, 3)
    assert set(triangles.ravel().tolist()) <= set(range(len(points)))
