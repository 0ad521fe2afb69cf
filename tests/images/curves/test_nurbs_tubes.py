"""Rational tubes: a circle of NURBS is a torus."""

from __future__ import annotations

import numpy as np

from .views import centres, curves, look, values

H = 0.7071067811865476
CIRCLE = f"""int[] curveVertexCounts = [9]
int[] order = [3]
double[] knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
double[] pointWeights = [1, {H}, 1, {H}, 1, {H}, 1, {H}, 1]
point3f[] points = [(1, 0, 0), (1, 1, 0), (0, 1, 0), (-1, 1, 0), (-1, 0, 0), (-1, -1, 0), (0, -1, 0), (1, -1, 0), (1, 0, 0)]
float[] widths = [0.6] (
    interpolation = "constant"
)
"""


def test_a_circle_is_a_torus() -> None:
    image = look(curves(CIRCLE, kind="NurbsCurves"), "position", "geometric_normal", "distance", size=96)
    x, y = centres(96)
    from_circle = np.hypot(x, y) - 1
    inside = np.abs(from_circle) < 0.3
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
    z = np.sqrt(0.09 - from_circle[inside] ** 2)
    assert (np.abs(values(image, "position")[inside][:, 2] - z) * z / 0.3).max() < 1e-3
    out = np.stack([x, y, 0 * x], axis=2)[inside] / np.hypot(x, y)[inside][:, None]
    n = (out * from_circle[inside][:, None] + np.array([0, 0, 1]) * z[:, None]) / 0.3
    assert (np.abs(values(image, "geometric_normal")[inside] - n).max(axis=1) * z / 0.3).max() < 1e-3
