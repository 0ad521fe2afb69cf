"""Tubes against closed forms: cylinders, cones, tori, ellipses, discs at their ends, wedges of balls at joints."""

from __future__ import annotations

import numpy as np
import pytest

from .views import centres, cubic, curves, linear, look, values

FLAT = "float[] widths = [{}] (\n interpolation = 'constant'\n)"
CYLINDERS = {
    "linear": linear("[(-1.5, 0, 0), (0.25, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8)),
    "bezier": cubic("[(-1.5, 0, 0), (-0.3, 0, 0), (0.1, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8)),
    "bspline": cubic("[(-1.5, 0, 0), (-0.3, 0, 0), (0.1, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8), "bspline", "pinned"),
    "catmullRom": cubic("[(-2.5, 0, 0), (-1.5, 0, 0), (0.1, 0, 0), (1.5, 0, 0), (2.5, 0, 0)]", FLAT.format(0.8), "catmullRom"),
    "pinned by two": cubic("[(-1.5, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8), "catmullRom", "pinned"),
}
AOVS = ("position", "geometric_normal", "normal", "distance")


@pytest.mark.conforms("BasisCurves.type")
@pytest.mark.conforms("BasisCurves.basis")
@pytest.mark.parametrize("kind", CYLINDERS)
def test_points_on_a_line_are_a_cylinder(kind: str) -> None:
    image = look(curves(CYLINDERS[kind]), *AOVS)
    x, y = centres()
    inside = (np.abs(x) < 1.5) & (np.abs(y) < 0.4)
    there = np.isfinite(values(image, "distance"))
    assert np.array_equal(there, inside)
    z = np.sqrt(0.16 - y[inside] ** 2)
    assert np.abs(values(image, "position")[inside] - np.stack([x[inside], y[inside], z], axis=1)).max() < 2e-5
    n = np.stack([0 * z, y[inside], z], axis=1) / 0.4
    assert np.abs(values(image, "geometric_normal")[inside] - n).max() < 1e-4
    assert np.abs(values(image, "distance")[inside] - (10 - z)).max() < 2e-5


@pytest.mark.parametrize("axis", [0.0, 1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("kind", ["linear", "bezier"])
def test_there_is_no_hole_along_the_axis(kind: str, axis: float) -> None:
    """Seen from the end: a disc, whatever ray comes down the axis."""
    ends = f"[(0, 0, -3), ({axis}, 0, 0), ({2 * axis}, 0, 3), ({3 * axis}, 0, 6)]"
    body = linear(ends, FLAT.format(2)) if kind == "linear" else cubic(ends, FLAT.format(2))
    image = look(curves(body), *AOVS, size=65)
    x, y = centres(65)
    disc = np.hypot(x - 3 * axis, y) < 1
    sure = np.abs(np.hypot(x - 3 * axis, y) - 1) > 0.01 + 3 * axis
    there = np.isfinite(values(image, "distance"))
    assert np.array_equal(there[sure], disc[sure])
    inside = disc & sure
    assert np.abs(values(image, "position")[inside][:, 2] - 6).max() < 1.1 * axis + 1e-5
    assert np.abs(values(image, "geometric_normal")[inside] - (0, 0, 1)).max() < axis + 1e-5


def test_a_cone_has_the_normals_of_a_cone() -> None:
    """Radius from 0.6 to 0.2 over a length of 3: outline and slope of discs across the axis, not of swept balls."""
    widths = "float[] widths = [1.2, 0.4] (\n interpolation = 'varying'\n)"
    image = look(curves(linear("[(-1.5, 0, 0), (1.5, 0, 0)]", widths)), *AOVS)
    x, y = centres()
    radius = 0.6 - 0.4 * (x + 1.5) / 3
    inside = (np.abs(x) < 1.5) & (np.abs(y) < radius)
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
    z = np.sqrt(radius**2 - y**2, where=inside, out=np.zeros_like(x))
    n = np.stack([radius * 0.4 / 3, y, z], axis=2)[inside]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    # Where a ray grazes the tube, two roots are near each other, and none is exact.
    off = np.abs(values(image, "geometric_normal")[inside] - n).max(axis=1)
    assert (off * n[:, 2]).max() < 3e-4
    assert (np.abs(values(image, "position")[inside][:, 2] - z[inside]) * n[:, 2]).max() < 5e-5


K = 0.5522847498307936


def test_a_loop_of_four_arcs_is_a_torus() -> None:
    """Bezier arcs are off a circle by 2.7e-4 of its radius; a closed loop has no ends."""
    points = (
        f"[(1, 0, 0), (1, {K}, 0), ({K}, 1, 0), (0, 1, 0), (-{K}, 1, 0), (-1, {K}, 0), (-1, 0, 0),"
        f" (-1, -{K}, 0), (-{K}, -1, 0), (0, -1, 0), ({K}, -1, 0), (1, -{K}, 0)]"
    )
    image = look(curves(cubic(points, FLAT.format(0.6), wrap="periodic")), *AOVS, size=96)
    x, y = centres(96)
    from_circle = np.hypot(x, y) - 1
    sure = np.abs(np.abs(from_circle) - 0.3) > 1e-3
    inside = (np.abs(from_circle) < 0.3) & sure
    assert np.array_equal(np.isfinite(values(image, "distance"))[sure], inside[sure])
    z = np.sqrt(0.09 - from_circle[inside] ** 2)
    slack = 4e-4 * 0.3 / z
    assert (np.abs(values(image, "position")[inside][:, 2] - z) < slack + 1e-5).all()


def test_a_bend_is_filled_by_part_of_a_ball_and_straight_joints_are_not() -> None:
    body = linear("[(-1, -1, 0), (0.5, -1, 0), (0.5, 1, 0)]", FLAT.format(1))
    image = look(curves(body), *AOVS, size=96)
    x, y = centres(96)
    first = (x > -1) & (x < 0.5) & (np.abs(y + 1) < 0.5)
    second = (y > -1) & (y < 1) & (np.abs(x - 0.5) < 0.5)
    ball = (x >= 0.5) & (y <= -1) & (np.hypot(x - 0.5, y + 1) < 0.5)
    sure = np.abs(np.hypot(x - 0.5, y + 1) - 0.5) > 0.01
    assert np.array_equal(np.isfinite(values(image, "distance"))[sure], (first | second | ball)[sure])
    at = ball & sure
    z = np.sqrt(0.25 - (x[at] - 0.5) ** 2 - (y[at] + 1) ** 2)
    assert np.abs(values(image, "position")[at][:, 2] - z).max() < 3e-6
    assert np.abs(values(image, "geometric_normal")[at][:, 2] - 2 * z).max() < 1e-5


PLACES = {
    "alone": ("float3 xformOp:scale = (1, 3, 0.5)", (1, 3, 0.5)),
    "mirrored": ("float3 xformOp:scale = (-1, 1, 1)", (-1, 1, 1)),
    "far smaller": ("float3 xformOp:scale = (0.5, 0.5, 0.5)", (0.5, 0.5, 0.5)),
    "flattened a little": ("float3 xformOp:scale = (1, 1, 0.99)", (1, 1, 0.99)),
}


@pytest.mark.parametrize("place", PLACES)
def test_scale_makes_tubes_elliptic(place: str) -> None:
    """Widths are lengths in object space."""
    operation, (sx, sy, sz) = PLACES[place]
    transform = f'{operation}\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    image = look(curves(CYLINDERS["bezier"], transform=transform), *AOVS)
    x, y = centres()
    inside = (np.abs(x) < 1.5 * abs(sx)) & (np.abs(y) < 0.4 * sy)
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
    z = sz * np.sqrt(0.16 - (y[inside] / sy) ** 2)
    assert np.abs(values(image, "position")[inside][:, 2] - z).max() < 2e-5
    n = np.stack([0 * z, y[inside] / sy**2, z / sz**2], axis=1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert np.abs(values(image, "geometric_normal")[inside] - n).max() < 2e-4


def test_rays_do_not_meet_the_tube_that_they_leave() -> None:
    """A white tube that is convex, under a white sky: 1 everywhere, at one scattering."""
    body = cubic("[(-1.5, 0, 0), (-0.3, 0, 0), (0.1, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8))
    white = "color3f[] primvars:displayColor = [(1, 1, 1)]"
    for text in (curves(body + white), curves(CYLINDERS["linear"] + white)):
        image = look(text, spp=16, max_depth=1)
        assert np.abs(image.pixels[..., :3] - 1).max() < 1e-5
