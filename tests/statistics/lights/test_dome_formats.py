"""Domes in every texture:format: the same direction has the same light, by formulas of their own, and sampling follows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.described import (
    describe,
    ground,
    kernels,
    lambert,
    light,
    look_at,
    orthographic,
    render,
    replicate_means,
    rotation,
)
from tests.statistics.chi_square import SphereCells, density_p_value
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import Doubles, Floats, Light, LightType

ROTATED = rotation([1, 2, -1], 70)


def angular(x: Doubles, y: Doubles) -> tuple[Doubles, np.ndarray]:
    """Directions of points of the square [-1, 1]^2, y up: as far off +z as r says, around it as on the page."""
    r, a = np.hypot(x, y), np.arctan2(y, x)
    return np.stack([np.sin(np.pi * r) * np.cos(a), np.sin(np.pi * r) * np.sin(a), np.cos(np.pi * r)], axis=-1), r <= 1


def mirrored_ball(x: Doubles, y: Doubles) -> tuple[Doubles, np.ndarray]:
    """What a sphere reflects to an eye far away at +z, by the law of reflection about its normal there."""
    n = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)
    return 2 * n[..., 2:] * n - [0.0, 0.0, 1.0], x * x + y * y <= 1


# Of each view of the cross, by column and row from the top: forward, right, up, seen from inside.
VIEWS = {
    (1, 1): ((0, 0, 1), (-1, 0, 0), (0, 1, 0)),
    (0, 1): ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    (2, 1): ((-1, 0, 0), (0, 0, -1), (0, 1, 0)),
    (1, 0): ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
    (1, 2): ((0, -1, 0), (-1, 0, 0), (0, 0, 1)),
    (1, 3): ((0, 0, -1), (-1, 0, 0), (0, -1, 0)),
}


def test_views_of_the_cross_are_not_mirrored() -> None:
    for forward, right, up in VIEWS.values():
        assert np.array_equal(np.cross(forward, up), right)


def vertical_cross(x: Doubles, y: Doubles) -> tuple[Doubles, np.ndarray]:
    column, row = np.floor((x + 1) * 1.5).astype(int), np.floor((1 - y) * 2).astype(int)
    u, v = ((x + 1) * 1.5 - column) * 2 - 1, 1 - ((1 - y) * 2 - row) * 2
    w, inside = np.zeros((*x.shape, 3)), np.zeros(x.shape, bool)
    for (c, r), (forward, right, up) in VIEWS.items():
        here = (column == c) & (row == r)
        inside |= here
        w[here] = (np.array(forward) + u[..., None] * np.array(right) + v[..., None] * np.array(up))[here]
    return w / np.maximum(np.linalg.norm(w, axis=-1), 1e-9)[..., None], inside


def latlong(x: Doubles, y: Doubles) -> tuple[Doubles, np.ndarray]:
    """UsdLux: longitude pi at the left edge, longitude pi / 2 towards +x, 0 towards +z."""
    longitude, latitude = -np.pi * x, np.pi / 2 * y
    c = np.cos(latitude)
    return np.stack([c * np.sin(longitude), np.sin(latitude), c * np.cos(longitude)], axis=-1), np.ones(x.shape, bool)


Layout = Callable[[Doubles, Doubles], tuple[Doubles, np.ndarray]]
LAYOUTS: dict[str, tuple[Layout, int, int]] = {
    "latlong": (latlong, 512, 256),
    "mirroredBall": (mirrored_ball, 512, 512),
    "angular": (angular, 512, 512),
    "cubeMapVerticalCross": (vertical_cross, 384, 512),
}


def sky(w: Doubles) -> Doubles:
    """Smooth, different everywhere, and brighter around one direction."""
    spot = np.exp(40 * (w @ np.array([0.48, 0.6, 0.64]) - 1))
    return np.stack([1.2 + w[..., 0], 1.2 + w[..., 1], 1.2 + w[..., 2]], axis=-1) + 5 * spot[..., None]


def picture(name: str) -> Floats:
    """The sky at the middle of every texel; what shows nothing is black."""
    layout, width, height = LAYOUTS[name]
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    w, inside = layout(x, y)
    return np.where(inside[..., None], sky(w), 0.0).astype(np.float32)


def dome(name: str) -> Light:
    return light(LightType.DOME, ROTATED, (1.0, 0.5, 2.0), texture_format=name)


CONFORMS = pytest.mark.conforms("DomeLight.inputs:texture:format", "DomeLight_1.inputs:texture:format")


@CONFORMS
@pytest.mark.parametrize("name", LAYOUTS)
def test_directions(name: str) -> None:
    scene = describe(lights=[dome(name)], dome_texture=picture(name)).build()
    w = np.random.default_rng(1).normal(size=(20_000, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    local = w @ ROTATED[:3, :3]
    L = kernels().dome_eval(scene, 0, w.astype(np.float32))[1] / [1.0, 0.5, 2.0]
    error = np.abs(L - sky(local)).max(axis=1)
    # The ball's edge shows what is behind it in no width at all: there a texel spans a fifth of a radian.
    seen = local[:, 2] > -0.98 if name == "mirroredBall" else np.ones(len(w), bool)
    assert np.quantile(error[seen], 0.99) < 0.01
    assert error[seen].max() < 0.06
    assert error.max() < 0.25  # and nothing of the black around
    one = kernels().dome_eval(scene, 0, w[:501].astype(np.float32), 1)
    many = kernels().dome_eval(scene, 0, w[:501].astype(np.float32))
    assert all(np.array_equal(a, b) for a, b in zip(one, many, strict=True))


@pytest.mark.parametrize("name", LAYOUTS)
def test_samples_follow_the_density(name: str) -> None:
    n = 40_000
    scene = describe(lights=[dome(name)], dome_texture=picture(name)).build()
    wi, t, pdf, L = kernels().light_sample(scene, 0, np.zeros((n, 3)), random_numbers(n, 2, seed=3))
    assert np.isinf(t).all()
    density, radiance = kernels().dome_eval(scene, 0, wi)
    assert np.mean(np.abs(density / pdf - 1) < 1e-5) > 0.99
    np.testing.assert_array_equal(radiance, L)
    cells = SphereCells(ROTATED[:3, :3] @ np.array([0.48, 0.6, 0.64]), spread=1.0, rings=16, points=32)

    def of(w: Doubles) -> Doubles:
        return kernels().dome_eval(scene, 0, w.astype(np.float32))[0]

    assert density_p_value(cells, of, wi, n) > 0.01 / len(LAYOUTS)
    # What exceeds a multiple of the mean is what is sampled: no bright direction is left out.
    w = np.random.default_rng(5).normal(size=(4000, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    found, light_there = kernels().dome_eval(scene, 0, w.astype(np.float32))
    mean = light_there[:, 1].mean()
    assert (found[light_there[:, 1] > 2.5 * mean] > 0).all()


def test_one_bright_texel_of_a_large_cross_is_sampled() -> None:
    pixels = np.full((2048, 1536, 3), 0.01, np.float32)
    pixels[700, 900] = 1e5
    scene = describe(lights=[light(LightType.DOME, texture_format="cubeMapVerticalCross")], dome_texture=pixels).build()
    _, _, pdf, L = kernels().light_sample(scene, 0, np.zeros((1000, 3)), random_numbers(1000, 2, seed=3))
    assert (L[:, 0] > 10).mean() > 0.2
    assert np.isfinite(pdf).all()


@CONFORMS
@pytest.mark.parametrize("name", [n for n in LAYOUTS if n != "latlong"])
def test_a_plane_is_lit_alike(name: str) -> None:
    camera = orthographic(look_at([0, 0.01, 0], [0, 0, 0], up=(0, 0, -1)), 0.5, clipping_range=(1e-4, 1.0))
    means = []
    for each in (name, "latlong"):
        d = describe([(ground(5), np.eye(4))], [lambert(1.0)], [dome(each)], camera, (8, 8), dome_texture=picture(each))
        means.append(replicate_means(render(d.build(), 256, max_depth=1)).mean(axis=(0, 1, 2)))
    np.testing.assert_allclose(means[0], means[1], rtol=3e-3)


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (3, 4), (5, 3)])
@pytest.mark.parametrize("name", [n for n in LAYOUTS if n != "latlong"])
def test_small_and_odd_images(name: str, size: tuple[int, int]) -> None:
    pixels = np.random.default_rng(3).random((size[1], size[0], 3)).astype(np.float32)
    scene = describe(lights=[light(LightType.DOME, texture_format=name)], textures={}, dome_texture=pixels).build()
    w = np.concatenate([np.eye(3), -np.eye(3), np.random.default_rng(4).normal(size=(500, 3))])
    w /= np.linalg.norm(w, axis=1)[:, None]
    pdf, L = kernels().dome_eval(scene, 0, w.astype(np.float32))
    assert np.isfinite(pdf).all()
    assert (L >= 0).all()  # and not NaN
    assert (pixels.max() * 1.00001 >= L).all()
