"""A lens's flaws and a rolling shutter as pictures: profiles, openings and slopes with closed forms; coverage stays."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.described import Described, box, describe, lambert, orthographic, perspective, quad, render, translation
from tests.images.motion.motion_scenes import GLOW, exposed, moving

from primray.description import Camera, Doubles, Exposure, Prototype
from primray.description.placement import Placement

SIDE = 32


def pictured(scene: Described, spp: int = 16, lanes: int = 0) -> Doubles:
    return np.asarray(render(scene.build(), spp, lanes=lanes).pixels(), np.float64)


def white(camera: Camera, spp: int = 16, lanes: int = 0) -> Doubles:
    """Inside of a box that glows with 1."""
    scene = describe([(box([50, 50, 50]), np.eye(4))], [lambert(0.0, 1.0)], camera=camera, resolution=(SIDE, SIDE))
    return pictured(scene, spp, lanes)


def lens(**changes: Any) -> Camera:
    return perspective(translation(0.3, 0.2, 0.1), 1.0, 1.0, **changes)


def centers(half: float = 1.0) -> Doubles:
    at = ((np.arange(SIDE) + 0.5) / SIDE * 2 - 1) * half
    return np.asarray(np.hypot(at[:, None], at[None]))


def test_natural_vignetting_is_cos_to_the_fourth() -> None:
    pixels = white(lens(natural_vignetting=True), 64)
    exact = (1 + centers() ** 2) ** -2.0
    assert np.abs(pixels[..., 0] - exact).max() < 5e-3  # a pixel's mean is not its centre's
    assert (pixels[..., 3] == 1).all()


def test_a_pinholes_rim_is_a_sharp_circle() -> None:
    pixels = white(lens(rim=(2.0, 1.5)), 64)
    radius, edge = centers(), 2.0 / SIDE * 0.75
    assert (pixels[radius < 0.75 - edge, 0] == 1).all()
    assert (pixels[radius > 0.75 + edge, 0] == 0).all()
    assert (pixels[..., 3] == 1).all()


def overlap(apart: float, a: float, b: float) -> float:
    """Area of two discs' common part."""
    if apart <= abs(a - b):
        return float(np.pi * min(a, b) ** 2)
    if apart >= a + b:
        return 0.0
    first = a * a * np.arccos((apart**2 + a * a - b * b) / (2 * apart * a))
    second = b * b * np.arccos((apart**2 + b * b - a * a) / (2 * apart * b))
    rest = 0.5 * np.sqrt((-apart + a + b) * (apart + a - b) * (apart - a + b) * (apart + a + b))
    return float(first + second - rest)


def test_mechanical_vignetting_is_the_overlap_of_two_openings() -> None:
    """Focused far away, a film point's rays are parallel: at the rim the lens's disc lies beside by its distance times tan."""
    pixels = white(lens(lens_radius=0.2, focus_distance=1e5, rim=(0.4, 0.25)), 1024)
    exact = np.vectorize(lambda t: overlap(0.4 * t, 0.2, 0.25))(centers()) / (np.pi * 0.2**2)
    assert exact.min() < 0.2
    assert np.abs(pixels[..., 0] - exact).max() < 0.04


def test_lateral_aberration_magnifies_each_channel() -> None:
    """A square's edge lies farther out in red, nearer in blue, by their magnifications; means stay."""
    mark = quad([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    camera = perspective(np.eye(4), 1.0, 1.0, channel_magnification=(1.5, 1.0, 0.5))
    scene = describe([(mark, translation(0, 0, -1))], [GLOW], camera=camera, resolution=(SIDE, SIDE))
    pixels = pictured(scene, 512)
    area = pixels[..., :3].sum(axis=(0, 1)) * (2 / SIDE) ** 2
    np.testing.assert_allclose(area, np.array([1.5, 1.0, 0.5]) ** 2, rtol=0.02)
    assert pixels[..., 3].sum() * (2 / SIDE) ** 2 == pytest.approx(np.mean([2.25, 1.0, 0.25]), rel=0.02)


def test_longitudinal_aberration_focuses_channels_apart() -> None:
    """At the distance where green is sharp, an edge blurs in red and blue by their circles of confusion."""
    z, radius, shifts = 4.0, 4.0, (1.0, 0.0, -0.5)
    mark = quad([[-40, -40, 0], [0, -40, 0], [0, 40, 0], [-40, 40, 0]])
    camera = perspective(np.eye(4), 0.25, 8.0, lens_radius=radius, focus_distance=z, channel_focus_shift=shifts)
    scene = describe([(mark, translation(0, 0, -z))], [GLOW], camera=camera, resolution=(256, 32))
    row = pictured(scene, 512)[..., :3].mean(axis=0)
    x = ((np.arange(256) + 0.5) / 256 * 2 - 1) * 2
    for channel, shift in enumerate(shifts):
        circle = radius * abs(1 / (z + shift) - 1 / z)
        near = np.abs(x) < circle + 0.1
        slope = -np.gradient(row[:, channel], x)[near]
        assert slope.sum() * (x[1] - x[0]) == pytest.approx(1.0, abs=0.02)
        spread = np.sqrt(max((slope * x[near] ** 2).sum() / slope.sum(), 0.0))
        assert spread == pytest.approx(circle / 2, abs=0.012)  # half a disc's radius is its spread across; a pixel is 0.016


@pytest.mark.parametrize(
    "flaws",
    [{"natural_vignetting": True}, {"rim": (2.0, 1.5)}, {"channel_magnification": (1.02, 1.0, 0.98)}],
    ids=["natural", "rim", "lateral"],
)
def test_lanes_do_not_show(flaws: dict[str, Any]) -> None:
    first = white(lens(**flaws), 8, 1)
    for lanes in (4, 8):
        np.testing.assert_array_equal(white(lens(**flaws), 8, lanes), first)


def bar(per_row: float, per_column: float = 0.0, opens: float = 0.0) -> Doubles:
    """A bar of half-width 1 that moves from x = -3 to 3 within the span; seen by lines that are open for an instant."""
    tall = quad([[-1, -9, 0], [1, -9, 0], [1, 9, 0], [-1, 9, 0]])
    level = moving([translation(-3, 0, 0), translation(3, 0, 0)], [0.0, 1.0])
    scene = describe(
        [], [GLOW], camera=orthographic(translation(0, 0, 10), 5.0, 1.0), resolution=(64, 64),
        prototypes=[Prototype("/p", ())], prototype_shapes=[tall], placements=[Placement(0, (level,))],
    )  # fmt: skip
    made = replace(scene.description.prototypes[0])
    described = replace(scene, description=replace(scene.description, prototypes=(made,)))
    return pictured(exposed(with_shape(described), Exposure(opens, opens, (0.0, 1.0), per_column, per_row)), 64)


def with_shape(scene: Described) -> Described:
    from primray.description import Placed

    d = scene.description
    return replace(scene, description=replace(d, prototypes=(replace(d.prototypes[0], shapes=(Placed(0, np.eye(4)),)),)))


@pytest.mark.parametrize(("per_row", "opens"), [(1 / 63, 0.0), (-1 / 63, 1.0)], ids=["down", "up"])
def test_a_rolling_shutter_shears_what_moves_sideways(per_row: float, opens: float) -> None:
    """Row j sees the bar where it stands at its own instant: 6 units of width over 63 rows."""
    pixels = bar(per_row, 0.0, opens)[..., 0]
    x = (np.arange(64) + 0.5) / 64 * 10 - 5
    found = (pixels * x).sum(axis=1) / pixels.sum(axis=1)
    exact = -3 + 6 * (opens + per_row * np.arange(64))
    assert np.abs(found - exact).max() < 0.02
    np.testing.assert_allclose(pixels.sum(axis=1) * 10 / 64, 2.0, atol=0.05)


def test_columns_roll_too() -> None:
    """The bar runs with the columns: it is wider by 1 / (1 - v), v its speed in columns of theirs."""
    pixels = bar(0.0, 1 / 63)[..., 0]
    width = pixels.sum(axis=1).mean() * 10 / 64
    speed = 6 / 63 / (10 / 64)
    assert width == pytest.approx(2.0 / (1 - speed), rel=0.02)
