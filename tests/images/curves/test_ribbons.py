"""Ribbons against closed forms: rectangles, trapezoids, and strips that bend without cracks."""

from __future__ import annotations

import numpy as np
import pytest

from .views import centres, covered, cubic, curves, linear, look, mean_alpha_error, values

WIDTH = "float[] widths = [0.8] (\n interpolation = 'constant'\n)"
UP = "normal3f[] normals = [({})] (\n interpolation = 'constant'\n)"


@pytest.mark.conforms("PointBased.normals")
@pytest.mark.parametrize("kind", ["linear", "bezier"])
def test_a_straight_ribbon_is_a_rectangle(kind: str) -> None:
    """As wide as its widths, across tangent and normal, facing its normal."""
    points = "[(-1.5, 0, 0), (-0.3, 0, 0), (0.1, 0, 0), (1.5, 0, 0)]"
    body = (linear if kind == "linear" else cubic)(points, WIDTH + "\n" + UP.format("0, 0, 1"))
    image = look(curves(body), "position", "normal", "geometric_normal", "distance")
    x, y = centres()
    inside = (np.abs(x) < 1.5) & (np.abs(y) < 0.4)
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
    assert np.abs(values(image, "position")[inside][:, 2]).max() < 1e-6
    assert np.abs(values(image, "normal")[inside] - (0, 0, 1)).max() < 1e-6


def test_a_tilted_ribbon_is_seen_narrower() -> None:
    body = linear("[(-1.5, 0, 0), (1.5, 0, 0)]", WIDTH + "\n" + UP.format("0, 0.6, 0.8"))
    image = look(curves(body), "geometric_normal", "distance")
    x, y = centres()
    inside = (np.abs(x) < 1.5) & (np.abs(y) < 0.4 * 0.8)
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
    assert np.abs(values(image, "geometric_normal")[inside] - (0, 0.6, 0.8)).max() < 1e-6


def test_the_area_of_a_bent_ribbon_is_its_width_along_its_length() -> None:
    """A ring of four arcs: no crack, no overlap that is seen."""
    k = 0.5522847498307936
    points = (
        f"[(1, 0, 0), (1, {k}, 0), ({k}, 1, 0), (0, 1, 0), (-{k}, 1, 0), (-1, {k}, 0), (-1, 0, 0),"
        f" (-1, -{k}, 0), (-{k}, -1, 0), (0, -1, 0), ({k}, -1, 0), (1, -{k}, 0)]"
    )
    text = curves(cubic(points, WIDTH.replace("0.8", "0.5") + "\n" + UP.format("0, 0, 1"), wrap="periodic"))
    image = look(text, spp=64, dicing_rate=0.5)
    assert abs(covered(image) - np.pi * (1.25**2 - 0.75**2)) < mean_alpha_error(image) / np.sqrt(32) + 2e-3
    x, y = centres()
    ring = np.abs(np.hypot(x, y) - 1) < 0.2
    assert (image.pixels[..., 3][ring] == 1).all()


def test_a_twisted_ribbon_turns_its_normal() -> None:
    """From facing the camera to facing up: half way it is turned by half as much, where the normals are linear."""
    body = linear(
        "[(-1.5, 0, 0), (1.5, 0, 0)]", WIDTH, "normal3f[] normals = [(0, 0, 1), (0, 1, 0)] (\n interpolation = 'varying'\n)"
    )
    image = look(curves(body), "normal", "distance", dicing_rate=0.25)
    x, y = centres()
    s = (x + 1.5) / 3
    n = np.stack([0 * s, s, 1 - s], axis=2) / np.hypot(s, 1 - s)[..., None]
    inside = (np.abs(x) < 1.4) & (np.abs(y) < 0.05) & (s < 0.8)
    assert np.isfinite(values(image, "distance"))[inside].all()
    # The surface between turned rulings leans along the curve, the more the further from its middle.
    assert np.abs(values(image, "normal")[inside] - n[inside]).max() < 0.1


def test_normals_along_the_tangent_are_no_crash() -> None:
    body = linear("[(-1.5, 0, 0), (1.5, 0, 0)]", WIDTH + "\n" + UP.format("1, 0, 0"))
    image = look(curves(body), "distance")
    assert np.isfinite(image.pixels).all()


def test_normals_that_do_not_fit_leave_tubes() -> None:
    more = "normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1)] (\n interpolation = 'varying'\n)"
    image = look(curves(linear("[(-1.5, 0, 0), (1.5, 0, 0)]", WIDTH, more)), "position")
    assert [d["code"] for d in image.report["diagnostics"] if d["code"] == "invalid-primvar"]
    assert values(image, "position")[..., 2].max() > 0.39


def test_edges_are_mitred_where_segments_meet_at_an_angle() -> None:
    """An L of two strips of width 0.8: two rectangles that share the square of the corner."""
    body = linear("[(-1.2, -0.8, 0), (0.8, -0.8, 0), (0.8, 1.2, 0)]", WIDTH + "\n" + UP.format("0, 0, 1"))
    image = look(curves(body), "distance")
    x, y = centres()
    inside = ((x > -1.2) & (x < 1.2) & (np.abs(y + 0.8) < 0.4)) | ((y > -1.2) & (y < 1.2) & (np.abs(x - 0.8) < 0.4))
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
