"""Meshes that emit: triangles chosen by where they are seen from, points on them by solid angle; against Lambert's formula."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from tests.described import (
    box,
    describe,
    ground,
    lambert,
    look_at,
    mesh,
    orthographic,
    placement,
    quad,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.reference.polygons import lambert_polygon

from primray.description import Doubles, Mesh, Placed, Prototype, Shape

EMITTED = 5.0
SURFACES = (lambert(1.0), lambert(0.0, emission=EMITTED))
# Straight down on the ground's middle, from below the lamps; what is seen of it is a point to them.
DOWN = orthographic(look_at([0, 0.3, 0], [0, 0, 0], up=(0, 0, -1)), 1e-3)


def irradiance(shapes: Sequence[tuple[Shape, Doubles]], spp: int, seed: int = 0, **more: object) -> tuple[float, float]:
    """Of the ground's middle, and its standard error."""
    d = describe([(ground(4), np.eye(4)), *shapes], SURFACES, [], DOWN, (16, 16), **more)  # type: ignore[arg-type]
    pixels = replicate_means(render(d.build(), spp, max_depth=1, seed=seed))[..., 1] * math.pi
    return float(pixels.mean()), float(np.abs(pixels[0] - pixels[1]).std() / 2 / math.sqrt(pixels[0].size))


def noise(shapes: Sequence[tuple[Shape, Doubles]], spp: int) -> float:
    """Relative standard error of a pixel."""
    value, error = irradiance(shapes, spp)
    return error * 16 / value


def by_lambert(corners: Doubles) -> float:
    """Irradiance of the ground's middle by a polygon above it."""
    return EMITTED * lambert_polygon(np.zeros(3), np.array([0.0, 1.0, 0.0]), corners)


TRIANGLES = {
    "far": [(-0.1, 2, 0.1), (0.15, 2, 0.1), (0, 2, -0.1)],
    "near": [(-2, 0.5, 1.5), (2, 0.5, 1), (0.2, 0.6, -3)],
    "very near": [(-20, 0.4, 15), (20, 0.4, 10), (2, 0.4, -30)],
    "long": [(-30, 0.5, 0.01), (30, 0.5, 0.01), (0, 0.5, -0.01)],
    "beside": [(0.4, 0.5, 9), (0.4, 0.5, -9), (0.4, 12, 0.3)],
    "hardly above": [(3, 0.1, 9), (3, 0.25, -9), (4, 0.05, 0.3)],
}


@pytest.mark.parametrize("name", TRIANGLES)
def test_a_triangle(name: str) -> None:
    corners = np.array(TRIANGLES[name], float)
    value, error = irradiance([(mesh(corners, [[0, 1, 2]], 1), np.eye(4))], 256)
    assert error < 0.003 * value
    assert abs(value - by_lambert(corners)) < 5 * error + 2e-4 * value


def tiles(rng: np.random.Generator) -> Mesh:
    """Triangles of all sizes above the ground, side by side."""
    points, triangles = [], []
    for x in range(-8, 8):
        for z in range(-8, 8):
            size = 10 ** rng.uniform(-2.5, -0.5)
            corner = np.array([0.4 * x + 0.2, 0.5, 0.4 * z + 0.2])
            points += [corner, corner + [size, 0, 0], corner + [0, 0, size]]
            triangles.append(np.arange(3)[:: rng.choice([1, -1])] + len(points) - 3)
    return mesh(points, triangles, 1)


def test_many_triangles() -> None:
    shape = tiles(np.random.default_rng(3))
    value, error = irradiance([(shape, np.eye(4))], 256)
    expected = sum(by_lambert(np.asarray(shape.points, float)[t]) for t in np.asarray(shape.triangles).reshape(-1, 3))
    assert abs(value - expected) < 5 * error + 2e-4 * value
    assert noise([(shape, np.eye(4))], 16) < 0.15  # 0.43 if chosen by power and area alone


FLAT = [(-1.0, 0.5, 2.0), (1.5, 0.5, 2.0), (1.5, 0.5, -1.0), (-1.0, 0.5, -1.0)]


def grid(n: int) -> Mesh:
    """That rectangle as 2 n^2 triangles."""
    u = np.linspace(0, 1, n + 1)
    a, b, c = np.array(FLAT[0]), np.array(FLAT[1]), np.array(FLAT[3])
    points = (a + u[:, None, None] * (b - a) + u[None, :, None] * (c - a)).reshape(-1, 3)
    at = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    return mesh(points, np.concatenate([np.stack([at, at + n + 1, at + n + 2], 1), np.stack([at, at + n + 2, at + 1], 1)]), 1)


@pytest.mark.parametrize("n", [1, 3, 30, 260])
def test_cut_into_triangles(n: int) -> None:
    """The last in more of them than there are leaves."""
    value, error = irradiance([(grid(n), np.eye(4))], 64)
    assert abs(value - by_lambert(np.array(FLAT))) < 5 * error + 2e-4 * value
    assert noise([(grid(n), np.eye(4))], 16) < 0.015  # 0.023 to 0.027 by power and area alone


def strip(x: float) -> Mesh:
    """Long, of 200 triangles, 0.3 above the ground."""
    z = np.linspace(-3, 3, 101)
    points = np.stack([np.stack([np.full(101, x + side), np.full(101, 0.3), z], 1) for side in (-0.02, 0.02)], 1).reshape(-1, 3)
    at = 2 * np.arange(100)
    return mesh(points, np.concatenate([np.stack([at, at + 1, at + 3], 1), np.stack([at, at + 3, at + 2], 1)]), 1)


def test_meshes_among_each_other_are_one_choice() -> None:
    """Strips side by side, whose balls overlap, with a mesh between them that does not emit: as if they were one mesh."""
    dark = (mesh([(9, 1, 9), (9, 2, 9), (9, 1, 8)], [[0, 1, 2]], 0), np.eye(4))
    places = [(strip(x), np.eye(4)) for x in (0.1, 0.9, 1.7, 2.5)]
    shapes = [places[0], dark, *places[1:]]
    value, error = irradiance(shapes, 256)
    corners = [
        np.array([(x - w, 0.3, -3), (x + w, 0.3, -3), (x + w, 0.3, 3), (x - w, 0.3, 3)])
        for x in (0.1, 0.9, 1.7, 2.5)
        for w in [0.02]
    ]
    assert abs(value - sum(by_lambert(c) for c in corners)) < 5 * error + 2e-4 * value
    assert noise(shapes, 16) < 0.05
    scene = describe([(ground(4), np.eye(4)), *shapes], SURFACES, [], DOWN, (16, 16)).build()
    assert scene.emitters == 4


PANELS = {
    "above": np.array(FLAT),
    "on edge": np.array([(0.4, 0.1, -3), (0.4, 0.1, 3), (0.4, 1.5, 3), (0.4, 1.5, -3)], float),
    "far": np.array([(4.0, 5, 0), (4.1, 5, 0.1), (4.0, 5.1, 0.2), (3.9, 5.1, 0.1)]) @ rotation([1, 2, 3], 20)[:3, :3],
    "sliver": np.array([(-20, 0.5, 0.01), (20, 0.5, 0.01), (20, 0.5, -0.01), (-20, 0.5, -0.01)]),
    "no rectangle": np.array([(-1.0, 0.5, 1.0), (1.0, 0.5, 1.0), (1.6, 0.5, -1.0), (-0.4, 0.5, -1.0)]),
}


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", PANELS)
def test_a_panel_of_two_triangles(name: str, turned: bool) -> None:
    """Whichever corner its triangles begin with, and whichever way round they are."""
    corners = PANELS[name]
    for first in range(3):
        for second in range(3):
            halves = np.stack([np.roll([0, 1, 2], first), np.roll([0, 2, 3], second)])
            value, error = irradiance([(mesh(corners, halves[:, ::-1] if turned else halves, 1), np.eye(4))], 64)
            assert abs(value - by_lambert(corners)) < 5 * error + 2e-4 * value


@pytest.mark.parametrize("count", [1, 2])
def test_a_flat_lamp_does_not_light_itself(count: int) -> None:
    """Of one triangle or of two: it shows its own radiance, though it is white and its points are rounded to both sides."""
    turned = rotation([1, 2, 3], 50) @ translation(3, -7, 20)
    corners = [(-0.5, 0, 0.5), (0.5, 0, 0.5), (0.5, 0, -0.5), (-0.5, 0, -0.5)]
    lamp = mesh(corners, [[0, 1, 2], [0, 2, 3]][:count], 0)
    camera = orthographic(turned @ look_at([0.2, 1, 0.25], [0.2, 0, 0.25], up=(0, 0, -1)), 0.2)
    d = describe([(lamp, turned)], [lambert(1.0, emission=EMITTED)], [], camera, (32, 32))
    assert np.abs(replicate_means(render(d.build(), 16, max_depth=2))[..., 1] / EMITTED - 1).max() < 1e-6


def test_a_panel_is_sampled_as_a_whole() -> None:
    """With less noise than its triangles, and the same where an instance squeezes it; not where one shears it."""
    panel = quad(PANELS["above"], 1)
    assert noise([(panel, np.eye(4))], 16) < 0.01
    for matrix, most in ((scaling(0.2, 1, 1), 0.01), (np.eye(4) + np.outer([1, 0, 0, 0], [0, 0, 1, 0]), 0.02)):
        value, error = irradiance([(panel, matrix)], 64)
        assert abs(value - by_lambert(PANELS["above"] @ matrix[:3, :3].T)) < 5 * error + 2e-4 * value
        assert noise([(panel, matrix)], 16) < most


@pytest.mark.parametrize("turned", [False, True])
def test_a_closed_mesh_shows_its_front(turned: bool) -> None:
    """Of a box only the lower side is seen from below, whichever way round its triangles are."""
    shape = box([1, 0.4, 1], 1)
    if turned:
        shape = mesh(shape.points, np.asarray(shape.triangles).reshape(-1, 3)[:, ::-1], 1)
    value, error = irradiance([(shape, translation(0, 1, 0))], 64)
    lower = np.array([(-0.5, 0.8, 0.5), (0.5, 0.8, 0.5), (0.5, 0.8, -0.5), (-0.5, 0.8, -0.5)])
    assert abs(value - by_lambert(lower)) < 5 * error + 2e-4 * value
    assert noise([(shape, translation(0, 1, 0))], 16) < 0.039  # 0.042 by power and area alone


MATRICES = {
    "flat": scaling(1, 0, 1),
    "mirrored": scaling(-1, 1, 1),
    "sheared": rotation([1, 1, 0], 30) @ scaling(1, 0.4, 1) @ rotation([0, 0, 1], 40),
    "tiny": scaling(1e-9, 1e-9, 1e-9) @ translation(0.3, 0.2, 0.1),
}


@pytest.mark.parametrize("name", MATRICES)
def test_instances(name: str) -> None:
    """Where they stand, by the same formula; a flat one has no inverse, a tiny one a determinant that is no float."""
    m = translation(0.2, 0.8, 0) @ MATRICES[name]
    size = 1e9 if name == "tiny" else 1.0
    corners = size * np.array([(-0.5, 0, 0.6), (0.7, 0, 0.5), (0.6, 0, -0.4), (-0.6, 0, -0.5)])
    far = translation(0, 1e4, 0) @ m
    prototype = Prototype("/p", (Placed(1, np.eye(4)),))
    value, error = irradiance(
        [],
        256,
        prototypes=[prototype],
        prototype_shapes=[quad(corners, 1)],
        placements=[placement(0, np.array([m[:3], far[:3]]))],
    )
    placed = corners @ m[:3, :3].T + m[:3, 3]
    assert abs(value - by_lambert(placed)) < 5 * error + 3e-4 * value
    assert error < 0.01 * value
