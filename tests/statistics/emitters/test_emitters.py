"""Geometry that emits, sampled as a light: against lights of the same shape, against closed forms, and against itself moved
into prototypes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    Described,
    box,
    describe,
    ground,
    lambert,
    light,
    look_at,
    mesh,
    orthographic,
    perspective,
    placement,
    quad,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)

from primray.description import Doubles, Light, LightType, Mesh, Placed, Prototype, Shape, Sphere, Surface

WHITE, LAMP = lambert(1.0), lambert(0.0, emission=5.0)
SURFACES = (WHITE, LAMP, lambert(0.3))
# Straight down on the ground's middle, from below the lamps: 0.2 x 0.2.
DOWN = orthographic(look_at([0, 0.3, 0], [0, 0, 0], up=(0, 0, -1)), 0.1)
SPP = 64


def irradiance(d: Described, spp: int = SPP) -> tuple[float, float]:
    """Mean over the picture of what a white ground sends back, times pi, and its standard error."""
    result = render(d.build(), spp, max_depth=1)
    assert result.invalid_samples == 0
    pixels = replicate_means(result)[..., 1] * math.pi
    return float(pixels.mean()), float(np.abs(pixels[0] - pixels[1]).std() / 2 / math.sqrt(pixels[0].size))


def below(shapes: Sequence[tuple[Shape, Doubles]], lights: Sequence[Light] = (), **more: object) -> Described:
    return describe([(ground(4), np.eye(4)), *shapes], SURFACES, lights, DOWN, (16, 16), **more)  # type: ignore[arg-type]


def lamp_quad(width: float, height: float) -> Mesh:
    w, h = width / 2, height / 2
    return quad([[-w, 1, h], [w, 1, h], [w, 1, -h], [-w, 1, -h]], 1)


def assert_same(a: tuple[float, float], b: tuple[float, float]) -> None:
    assert abs(a[0] - b[0]) < 5 * math.hypot(a[1], b[1]) + 1e-4 * b[0], (a, b)


@pytest.mark.parametrize("size", [(0.05, 0.05), (0.7, 0.3), (20.0, 30.0)])
def test_a_rectangle_is_a_rect_light(size: tuple[float, float]) -> None:
    width, height = size
    as_light = light(LightType.RECT, translation(0, 1, 0) @ rotation([1, 0, 0], -90), 5.0, width=width, height=height)
    a, b = irradiance(below([(lamp_quad(width, height), np.eye(4))])), irradiance(below([], [as_light]))
    assert_same(a, b)
    assert a[1] < 0.01 * a[0]  # sampled, not met by chance: that had 15 % for the smallest


@pytest.mark.parametrize("matrix", [np.eye(4), scaling(1, 0.4, 2), rotation([1, 2, 3], 50) @ scaling(0.3, 1, 1)])
def test_a_sphere_is_a_sphere_light(matrix: Doubles) -> None:
    at = translation(0.3, 1, 0.1) @ matrix
    a = irradiance(below([(Sphere("/s", 0.2, 1), at)]))
    b = irradiance(below([], [light(LightType.SPHERE, at, 5.0, radius=0.2)]))
    assert_same(a, b)
    assert a[1] < 0.01 * a[0]


def test_closed_form_of_a_sphere() -> None:
    """E = pi L (r / d)^2 straight below."""
    point = orthographic(look_at([0, 0.3, 0], [0, 0, 0], up=(0, 0, -1)), 1e-4)
    d = below([(Sphere("/s", 0.25, 1), translation(0, 1, 0))])
    value, error = irradiance(replace(d, description=replace(d.description, camera=point)))
    assert abs(value - math.pi * 5.0 * 0.25**2) < 5 * error + 1e-4 * value


def tent() -> Mesh:
    """Triangles of very different sizes, of which some do not emit."""
    rng = np.random.default_rng(5)
    points, triangles, surfaces = [], [], []
    for i in range(40):
        size = 10 ** rng.uniform(-3, -0.7)
        center = rng.uniform([-0.5, 0.8, -0.5], [0.5, 1.2, 0.5])
        points += [center + size * rng.normal(size=3) for _ in range(3)]
        triangles.append([3 * i, 3 * i + 1, 3 * i + 2])
        surfaces.append(1 if i % 3 else 2)
    return replace(mesh(points, triangles), surface=np.array(surfaces, np.int32))


PLACES = {
    "moved": translation(0.2, 0.1, 0),
    "mirrored": scaling(-1, 1, 1),
    "squashed": translation(0, 0.5, 0) @ scaling(1, 0.5, 1.7),
    "sheared": translation(0, 0.6, 0) @ rotation([1, 1, 0], 30) @ scaling(1, 0.4, 1) @ rotation([0, 0, 1], 40),
}


@pytest.mark.parametrize("name", PLACES)
def test_an_instance_is_the_shape_itself(name: str) -> None:
    m = PLACES[name]
    shapes: list[Shape] = [tent(), Sphere("/s", 0.1, 1)]
    inner = [np.eye(4), translation(0.4, 0.9, 0.3) @ scaling(1, 1, 0.4)]
    still = below([(s, m @ i) for s, i in zip(shapes, inner, strict=True)])
    # A second instance far away, so that this is a true placement of two.
    rows = np.array([m[:3], (translation(0, 1e4, 0) @ m)[:3]])
    prototype = Prototype("/p", (Placed(1, inner[0]), Placed(2, inner[1])))
    placed = below([], prototypes=[prototype], prototype_shapes=shapes, placements=[placement(0, rows)])
    a, b = irradiance(still, 256), irradiance(placed, 256)
    assert_same(a, b)
    assert a[1] < 0.02 * a[0]


def test_many_emitters_among_other_lights() -> None:
    """More than are weighed one by one: chosen by a tree. Sum of the parts' irradiances."""
    rng = np.random.default_rng(2)
    places = [translation(*rng.uniform([-1, 0.5, -1], [1, 1.5, 1])) @ scaling(s, s, s) for s in rng.uniform(0.05, 0.3, 12)]
    shapes: list[tuple[Shape, Doubles]] = [
        (box([0.3, 0.3, 0.3], 1) if i % 2 else Sphere("/s", 0.2, 1), m) for i, m in enumerate(places)
    ]
    lights = [light(LightType.POINT, translation(0.1 * i, 1, 0), 0.1) for i in range(8)]
    parts = [irradiance(below([s])) for s in shapes] + [irradiance(below([], [x])) for x in lights]
    total = irradiance(below(shapes, lights), 1024)
    # Lamps shade one another a little less than their noise.
    assert abs(total[0] - sum(p[0] for p in parts)) < 0.02 * total[0]


@pytest.mark.parametrize("roughness", [0.1, 0.4])
def test_glossy_ground(roughness: float) -> None:
    """Most is found by the surface's own rays there: the weights of both ways must add up to 1."""
    metal = Surface("", diffuse_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=roughness)
    camera = perspective(look_at([0, 0.5, 2], [0, 0.1, 0]), 0.3)
    images = []
    for use_light in (False, True):
        lamp = light(LightType.RECT, translation(0, 1, 0) @ rotation([1, 0, 0], -90), 5.0, width=1.0, height=1.0)
        shapes: list[tuple[Shape, Doubles]] = [(ground(1), np.eye(4))]
        if not use_light:
            shapes.append((lamp_quad(1, 1), np.eye(4)))
        d = describe(shapes, (metal, LAMP), [lamp] if use_light else [], camera, (24, 24))
        images.append(replicate_means(render(d.build(), 256, max_depth=1)))
    a, b = (i.mean(axis=(0, 3)) for i in images)
    noise = sum(np.square(i[0] - i[1]).mean() / 4 for i in images)
    assert abs(a.mean() - b.mean()) < 5 * math.sqrt(noise / a.size) + 1e-4 * b.mean()


def test_closed_box() -> None:
    """Le = 0.5, albedo 0.5: L = 1 everywhere inside."""
    d = describe(
        [(box([2, 3, 4]), np.eye(4))], [lambert(0.5, emission=0.5)], camera=perspective(np.eye(4), 1.0), resolution=(16, 16)
    )
    mean = replicate_means(render(d.build(), 256)).mean(axis=0)[..., 0]
    assert abs(mean.mean() - 1) < 5 * mean.std() / 16


def test_presence_scales_emission() -> None:
    """Half of it is there: half the radiance, seen directly and as light."""
    ghost = Surface(
        "", diffuse_color=(0, 0, 0), emissive_color=(4, 4, 4), opacity=0.5, presence=True, use_specular_workflow=True
    )
    eye = orthographic(look_at([0, 0.5, 0], [0, 1, 0], up=(0, 0, -1)), 0.1)
    seen = describe([(lamp_quad(1, 1), np.eye(4))], [WHITE, ghost], camera=eye)
    np.testing.assert_allclose(replicate_means(render(seen.build(), 16))[..., 1], 2.0, rtol=1e-5)
    lit = describe([(ground(4), np.eye(4)), (lamp_quad(1, 1), np.eye(4))], [WHITE, ghost], camera=DOWN, resolution=(16, 16))
    whole = describe(
        [(ground(4), np.eye(4)), (lamp_quad(1, 1), np.eye(4))], [WHITE, lambert(0.0, 2.0)], camera=DOWN, resolution=(16, 16)
    )
    assert_same(irradiance(lit, 256), irradiance(whole, 256))


def test_very_near_lamp() -> None:
    """A lamp 1e-4 above the ground, in coordinates of 1: no ray to it may be blocked by itself."""
    d = below([(lamp_quad(0.5, 0.5), translation(0, 1e-4 - 1, 0))])
    camera = orthographic(look_at([0, 5e-5, 0], [0, 0, 0], up=(0, 0, -1)), 0.1, clipping_range=(1e-6, 1.0))
    value, error = irradiance(replace(d, description=replace(d.description, camera=camera)), 256)
    assert abs(value - 5 * math.pi) < 0.01 * value + 5 * error


def test_too_many_instances_are_said_to_be_unsampled() -> None:

    from primray.core.scene_upload import upload

    rows = np.tile(np.eye(4)[:3], ((1 << 18) + 1, 1, 1))
    rows[:, 0, 3] = np.arange(len(rows))
    d = below(
        [],
        prototypes=[Prototype("/p", (Placed(1, np.eye(4)),))],
        prototype_shapes=[box([0.1] * 3, 1)],
        placements=[placement(0, rows)],
    )
    _, warnings, _ = upload(d.description, {}, 1.0, np.zeros(0, np.float32))
    assert [w[0] for w in warnings] == ["emitters-unsampled"]
