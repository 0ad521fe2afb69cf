"""Renders whose answer is known: closed spheres, furnaces, glass, instances, and the box of CSE 168's first project."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    Described,
    box,
    describe,
    lambert,
    light,
    look_at,
    perspective,
    placement,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)

from primray.description import LightType, Placed, Prototype, Sphere, Surface

DOME = light(LightType.DOME, emission=0.7)
FROM = look_at([0, 0, 3], [0, 0, 0])
SPHERE = Sphere("/s", 1.0, 0)


def image(d: Described, spp: int, max_depth: int = 1 << 20) -> np.ndarray:
    result = render(d.build(), spp, max_depth=max_depth)
    assert result.invalid_samples == 0
    return replicate_means(result).mean(axis=0)


def test_closed_lambert_sphere() -> None:
    """Le = 0.5, albedo 0.5: L = Le / (1 - albedo) = 1 in every direction."""
    d = describe(
        [(SPHERE, np.eye(4))],
        [lambert(0.5, emission=0.5)],
        camera=perspective(translation(0.2, 0.1, -0.3), 1.0),
        resolution=(16, 16),
    )
    result = render(d.build(), 256)
    halves = replicate_means(result)
    mean = halves.mean(axis=0)[..., 0]
    # Independent of direction, so that all pixels estimate one number; five standard errors.
    assert abs(mean.mean() - 1) < 5 * mean.std() / 16 + 1e-6
    assert mean.std() < 0.05


def test_closed_sphere_by_depth() -> None:
    """After n scatterings: Le (1 + a + ... + a^n)."""
    d = describe([(SPHERE, np.eye(4))], [lambert(0.5, emission=0.5)], camera=perspective(np.eye(4), 1.0))
    for depth in (1, 2, 3):
        np.testing.assert_allclose(image(d, 8, depth), 0.5 * sum(0.5**k for k in range(depth + 1)), rtol=2e-5)


WHITE = {
    "lambert": lambert(1.0),
    "mirror": Surface("", diffuse_color=(1, 1, 1), metallic=1.0, roughness=0.0),
    "thin glass": Surface("", opacity=0.0, roughness=0.0, thin=True),
    "nothing": Surface("", opacity=0.0, presence=True),
}


@pytest.mark.parametrize("name", WHITE)
@pytest.mark.parametrize("shape", ["sphere", "box", "mirrored", "squashed"])
def test_white_furnace(name: str, shape: str) -> None:
    m = {"mirrored": scaling(-1, 1, 1), "squashed": rotation([1, 1, 0], 40) @ scaling(1, 0.2, 0.7)}.get(shape, np.eye(4))
    geometry = box([1, 1, 1]) if shape == "box" else SPHERE
    d = describe([(geometry, m)], [WHITE[name]], [DOME], perspective(FROM, 0.4), (24, 24))
    np.testing.assert_allclose(image(d, 16), 0.7, rtol=1e-5)


def test_glass_furnace() -> None:
    """A lossless glass ball under a constant dome cannot be seen; roulette ends some paths, hence noise."""
    d = describe([(SPHERE, np.eye(4))], [Surface("", opacity=0.0, roughness=0.0)], [DOME], perspective(FROM, 0.4), (24, 24))
    pixels = image(d, 64)[..., 0]
    assert abs(pixels.mean() / 0.7 - 1) < 5 * pixels.std() / 0.7 / 24 + 1e-5
    assert pixels.std() < 0.02


def test_nothing_reflects_more_than_it_receives() -> None:
    for s in (
        Surface("", diffuse_color=(1, 1, 1), roughness=r, metallic=m, clearcoat=c)
        for r in (0.1, 0.5)
        for m in (0.0, 1.0)
        for c in (0.0, 1.0)
    ):
        d = describe([(SPHERE, np.eye(4))], [s], [DOME], perspective(FROM, 0.36), (8, 8))
        pixels = image(d, 512)[..., 0]
        assert pixels.mean() < 0.7 * (1 + 1e-3)


def test_instances_look_as_what_they_are() -> None:
    """Mirrored, scaled and turned instances, noise-free: emission, seen through different paths of the code."""
    matrices = [
        translation(-0.6, 0, 0) @ scaling(-0.5, 0.5, 0.5),
        translation(0.6, 0, 0) @ rotation([0, 1, 0], 50) @ scaling(0.3, 0.5, 0.2),
    ]
    cube = box([1, 1, 1])
    camera = perspective(FROM, 0.5)
    surfaces = [lambert(0.8)]
    sun = light(LightType.DISTANT, rotation([1, 0.5, 0], -40), math.pi)
    flat = describe([(cube, m) for m in matrices], surfaces, [sun], camera, (48, 32))
    prototype = Prototype("/p", (Placed(0, np.eye(4)),))
    instanced = describe([], surfaces, [sun], camera, (48, 32), [prototype], [cube], [placement(0, matrices)])
    np.testing.assert_allclose(image(flat, 4, 1), image(instanced, 4, 1), atol=1e-5)


# CSE 168, project 1: scenes/analytic/cse168_project1.usda.
WIDTH, HEIGHT = 800, 600
SKY = (0.8, 0.9, 1.0)
SIZE = np.array([0.5, 0.2, 0.3])
POSITION, INTENSITY = np.array([1, 2, 1.5]), np.array([1, 0.2, 0.2]) * 10
TANGENT = math.tan(math.radians(25))


# The pixels around the box: columns and rows of the whole image.
LEFT, RIGHT, TOP, BOTTOM = 350, 450, 260, 340


def project1() -> Described:
    """The part of the image around the box, on the whole image's pixel grid."""
    sky = light(LightType.DOME, emission=SKY, diffuse=0.0, specular=0.0)
    lamp = light(LightType.POINT, translation(*POSITION), tuple(INTENSITY))
    x, y = 2 * TANGENT * 1.33 / WIDTH, 2 * TANGENT / HEIGHT
    window = ((LEFT - WIDTH / 2) * x, (RIGHT - WIDTH / 2) * x, (HEIGHT / 2 - BOTTOM) * y, (HEIGHT / 2 - TOP) * y)
    camera = replace(perspective(look_at([0, 2, 5], [0, 0, 0]), TANGENT), window=window)
    return describe([(box(SIZE), np.eye(4))], [lambert(1.0)], [sky, lamp], camera, (RIGHT - LEFT, BOTTOM - TOP))


def face_through(d: np.ndarray, o: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The box's face that rays meet (axis + 3 (towards +), -1: none) and where: slabs, Kay and Kajiya 1986."""
    with np.errstate(divide="ignore"):
        near, far = sorted_slabs(o, d)
    t0, t1 = near.max(axis=-1), far.min(axis=-1)
    axis = near.argmax(axis=-1)
    hit = (t0 < t1) & (t0 > 0)
    p = o + d * t0[..., None]
    up = np.take_along_axis(p, axis[..., None], axis=-1)[..., 0] > 0
    return np.where(hit, axis + 3 * up, -1), p


def sorted_slabs(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b = (-SIZE / 2 - o) / d, (SIZE / 2 - o) / d
    return np.minimum(a, b), np.maximum(a, b)


def test_cse168_project1() -> None:
    scene = project1()
    pixels = image(scene, 512)
    m = scene.description.camera.world_from_camera

    def rays(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        local = np.stack([(2 * x / WIDTH - 1) * TANGENT * 1.33, (1 - 2 * y / HEIGHT) * TANGENT, -np.ones_like(x)], axis=-1)
        return local @ m[:3, :3].T

    x, y = np.meshgrid(np.arange(LEFT, RIGHT + 1.0), np.arange(TOP, BOTTOM + 1.0))
    corner, _ = face_through(rays(x, y), m[:3, 3])
    inside = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[:-1, 1:], corner[1:, 1:]])
    whole = (inside == inside[0]).all(axis=0)
    face = np.where(whole, inside[0], -2)
    np.testing.assert_array_equal(
        pixels[face == -1], np.broadcast_to(np.asarray(SKY, np.float32), (int((face == -1).sum()), 3))
    )
    assert sorted(np.unique(face)) == [-2, -1, 4, 5]  # from there only the top and the front are seen
    nodes, weights = np.polynomial.legendre.leggauss(3)
    for number in (4, 5):
        rows, columns = np.nonzero(face == number)
        expected = np.zeros((len(rows), 3))
        for a, wa in zip(nodes, weights, strict=True):
            for b, wb in zip(nodes, weights, strict=True):
                _, p = face_through(rays(LEFT + columns + 0.5 + a / 2, TOP + rows + 0.5 + b / 2), m[:3, 3])
                to = POSITION - p
                r = np.linalg.norm(to, axis=1)
                expected += wa * wb / 4 * INTENSITY * (to[:, number - 3] / r**3 / math.pi)[:, None]
        assert len(rows) > 500
        np.testing.assert_allclose(pixels[rows, columns], expected, rtol=1e-4)
