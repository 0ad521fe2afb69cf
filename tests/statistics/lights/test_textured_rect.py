"""Rectangle lights with an image: upright by UsdLux's text, sampled by what rays find, and by far less noise than blindly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.described import (
    describe,
    ground,
    image,
    kernels,
    lambert,
    light,
    look_at,
    orthographic,
    quad,
    render,
    replicate_means,
    rotation,
    scaling,
    translation,
)
from tests.statistics.chi_square import count_p_value
from tests.statistics.lights.placed_lights import PLACED, SHEAR, parameters, patches, view_point
from tests.statistics.surfaces.surface_cases import random_numbers

from primray.description import Doubles, Floats, Light, LightType, Surface, TextureFile

FILE = TextureFile("rect", "raw")
N = 40_000
RNG = np.random.default_rng(11)

IMAGES: dict[str, Floats] = {
    "spot": np.pad(np.full((2, 2, 3), 900.0, np.float32), ((20, 10), (40, 22), (0, 0)), constant_values=0.2),
    "noise": (RNG.random((9, 7, 3)) ** 4).astype(np.float32),
    "constant": np.full((4, 4, 3), 0.7, np.float32),
    "one texel": np.array([[[0.5, 1.0, 2.0]]], np.float32),
    "black but for one": np.pad(np.full((1, 1, 3), 5.0, np.float32), ((0, 63), (0, 31), (0, 0))),
}
MATRICES = {
    "placed": PLACED,
    "scaled": PLACED @ scaling(2, 0.5, 3),
    "sheared": PLACED @ SHEAR,
    "mirrored": PLACED @ scaling(-1, 1, 1),
}
PLACES = [("placed", "near"), ("placed", "far"), ("scaled", "middle"), ("sheared", "near"), ("mirrored", "grazing")]
CASES = [(name, where, view) for name in IMAGES for where, view in PLACES]
SIGNIFICANCE = 0.01 / len(CASES)


def lamp(matrix: Doubles, emission: float | tuple[float, float, float] = 1.0) -> Light:
    return light(LightType.RECT, matrix, emission, width=0.8, height=0.5, texture=FILE)


def scene_of(x: Light, pixels: Floats) -> object:
    return describe(lights=[x], textures={FILE: image(pixels)}).build()


def rows(p: Doubles, n: int) -> Doubles:
    return np.ascontiguousarray(np.broadcast_to(p, (n, 3)), np.float64)


def read(pixels: Floats, uv: Doubles) -> Doubles:
    """By the text: the image's first row and column at +Y and +X; bilinear, clamped. `uv` as in `parameters`."""
    height, width = pixels.shape[:2]
    x, y = (1 - uv[:, 0]) * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - i)[:, None], (y - j)[:, None]

    def texel(row: np.ndarray, column: np.ndarray) -> Doubles:
        return pixels[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(np.float64)

    top = texel(j, i) * (1 - fx) + texel(j, i + 1) * fx
    return (top * (1 - fy) + (texel(j + 1, i) * (1 - fx) + texel(j + 1, i + 1) * fx) * fy).astype(np.float64)


@pytest.mark.parametrize(("name", "where", "view"), CASES)
def test_samples_follow_the_density(name: str, where: str, view: str) -> None:
    x, pixels = lamp(MATRICES[where]), IMAGES[name]
    scene, p = scene_of(x, pixels), view_point(x, view)
    wi, t, pdf, L = kernels().light_sample(scene, 0, rows(p, N), random_numbers(N, 2, seed=5))
    assert (pdf > 0).mean() > 0.999
    seen = pdf > 0
    wi, t, pdf, L = wi[seen], t[seen], pdf[seen], L[seen]
    hit_pdf = kernels().light_hit(scene, 0, rows(p, len(wi)), wi)[1]
    met = hit_pdf > 0
    assert met.mean() > 0.995
    # Between texels rounding decides which density it is.
    assert np.quantile(np.abs(hit_pdf / pdf - 1)[met], 0.97) < 3e-3
    # As many samples in each sixteenth of a texel (at most 64 cells an axis) as the density says.
    cells = [min(2 * n, 64) for n in (pixels.shape[1], pixels.shape[0])]
    uv = np.clip(parameters(x, p + wi.astype(np.float64) * t[:, None]), 0, 1)
    observed = np.histogram2d(uv[:, 0], uv[:, 1], bins=cells, range=((0, 1), (0, 1)))[0]
    each = max(3, 128 // min(cells))
    s = patches(x, cells[0] * each, cells[1] * each)
    to = s.p - p
    d2 = np.sum(to * to, axis=1)
    w = to / np.sqrt(d2)[:, None]
    density = kernels().light_hit(scene, 0, rows(p, len(w)), w.astype(np.float32))[1].astype(np.float64)
    mass = density * np.maximum(-np.sum(w * s.n, axis=1), 0) * s.area / d2
    probability = mass.reshape(cells[0], each, cells[1], each).sum(axis=(1, 3))
    assert probability.sum() == pytest.approx(1, abs=5e-3)
    assert count_p_value(probability.ravel() / probability.sum(), observed.ravel(), len(wi)) > SIGNIFICANCE


@pytest.mark.conforms("RectLight.inputs:texture:file")
@pytest.mark.parametrize("where", MATRICES)
def test_the_image_is_upright_and_multiplies(where: str) -> None:
    pixels = RNG.random((6, 9, 3)).astype(np.float32)
    x = lamp(MATRICES[where], (2.0, 0.5, 1.0))
    scene, p = scene_of(x, pixels), view_point(x, "middle")
    s = patches(x, 60)
    w = (s.p - p) / np.linalg.norm(s.p - p, axis=1)[:, None]
    L = kernels().light_radiance(scene, 0, rows(p, len(w)), w.astype(np.float32))
    np.testing.assert_allclose(L, read(pixels, parameters(x, s.p)) * [2.0, 0.5, 1.0], atol=2e-5)
    wi, t, _, L = kernels().light_sample(scene, 0, rows(p, 500), random_numbers(500, 2, seed=2))
    at = p + wi.astype(np.float64) * t[:, None]
    np.testing.assert_allclose(L, read(pixels, parameters(x, at)) * [2.0, 0.5, 1.0], atol=2e-5)


def test_lanes_do_not_change_bits() -> None:
    scene = scene_of(lamp(MATRICES["sheared"]), IMAGES["spot"])
    p, u = RNG.normal(size=(333, 3)) * 2, random_numbers(333, 2, seed=4)
    seen = kernels().light_sample(scene, 0, p, u)[2] > 0
    assert seen.any()
    for one, many in zip(kernels().light_sample(scene, 0, p, u, 1), kernels().light_sample(scene, 0, p, u), strict=True):
        assert np.array_equal(one[seen], many[seen])


def lit_plane(name: str, surface: Surface, spp: int) -> tuple[Doubles, float]:
    """Replicates (2, H, W, 3) of a plane below, and the mean irradiance on it by quadrature, green."""
    x = replace(lamp(translation(0.2, 0.8, -0.1) @ rotation([1, 0.3, 0], -85)), width=1.2, height=0.9)
    camera = orthographic(look_at([0, 0.01, 0], [0, 0, 0], up=(0, 0, -1)), 0.6, clipping_range=(1e-4, 1.0))
    d = describe([(ground(5), np.eye(4))], [surface], [x], camera, (8, 8), textures={FILE: image(IMAGES[name])})
    result = render(d.build(), spp, max_depth=1)
    assert result.invalid_samples == 0
    s = patches(x, 300)
    value = read(IMAGES[name], parameters(x, s.p))[:, 1]
    c = (np.arange(16) + 0.5) / 16 * 1.2 - 0.6
    total = 0.0
    for px in c:
        for pz in c:
            to = s.p - [px, 0, pz]
            d2 = np.sum(to * to, axis=1)
            total += float(np.sum(value * np.maximum(to[:, 1], 0) * np.maximum(-np.sum(to * s.n, axis=1), 0) * s.area / d2**2))
    return replicate_means(result), total / 256


@pytest.mark.parametrize("name", IMAGES)
def test_irradiance(name: str) -> None:
    pixels, expected = lit_plane(name, lambert(1.0), 256)
    e = pixels[..., 1] * math.pi
    error = float(np.abs(e[0] - e[1]).std() / 2 / 8)
    assert abs(e.mean() - expected) < 4 * error + 1e-3 * expected
    # Nearly as good as a plain light, where one texel of 2048 has all of the light: blindly that had 30 % here.
    assert error < 5e-3 * expected


def test_glossy_ground_agrees_with_geometry_of_the_same_light() -> None:
    """Scattered rays find much of it there: both ways' weights must add up to 1. Four texels as four lamps."""
    pixels = np.array([[1.0, 30.0], [3.0, 0.5]], np.float32)[:, :, None].repeat(3, 2)
    sharp = pixels.repeat(64, 0).repeat(64, 1)
    metal = Surface("", diffuse_color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.3)
    m = translation(0, 1, 0) @ rotation([1, 0, 0], -90)
    camera = orthographic(look_at([0, 0.6, 1], [0, 0.1, 0]), 0.4)
    whole = describe([(ground(2), np.eye(4))], [metal], [replace(lamp(m), width=1.0, height=1.0)], camera, (12, 12),
                     textures={FILE: image(sharp)})  # fmt: skip
    parts = []
    for row in range(2):
        for column in range(2):
            at = m @ translation(0.25 - 0.5 * column, 0.25 - 0.5 * row, 0)
            parts.append(light(LightType.RECT, at, float(pixels[row, column, 0]), width=0.5, height=0.5))
    four = describe([(ground(2), np.eye(4))], [metal], parts, camera, (12, 12))
    a, b = (replicate_means(render(d.build(), 1024, max_depth=1)) for d in (whole, four))
    noise = math.sqrt(sum(np.square(i[0] - i[1]).mean() / 4 for i in (a, b)) / a[0].size * 3)
    assert abs(a.mean() - b.mean()) < 5 * noise + 4e-3 * b.mean()


@pytest.mark.conforms("RectLight.inputs:texture:file")
def test_the_camera_and_mirrors_see_the_image() -> None:
    """Looking at it from in front, +X is on the left: the picture is the file's, first row at the top."""
    pixels = np.kron(np.array([[1.0, 2.0], [3.0, 4.0]]), np.ones((8, 8))).astype(np.float32)[:, :, None].repeat(3, 2)
    x = light(LightType.RECT, np.eye(4), width=1.0, height=1.0, texture=FILE)
    eye = orthographic(look_at([0, 0, -2], [0, 0, 0]), 0.5)
    d = describe([], [], [x], eye, (4, 4), textures={FILE: image(pixels)})
    seen = render(d.build(), 16).pixels()[..., 0]
    np.testing.assert_allclose(seen[[0, 0, 3, 3], [0, 3, 0, 3]], [1, 2, 3, 4], atol=1e-3)
    mirror = Surface("", diffuse_color=(1, 1, 1), metallic=1.0, roughness=0.0)
    glass = quad([[-2, -2, -3], [2, -2, -3], [2, 2, -3], [-2, 2, -3]], 0)  # faces +z
    behind = orthographic(look_at([0, 0, -1], [0, 0, -3]), 0.5)
    d = describe([(glass, np.eye(4))], [mirror], [x], behind, (4, 4), textures={FILE: image(pixels)})
    corners = render(d.build(), 16).pixels()[[0, 0, 3, 3], [0, 3, 0, 3], 0]
    np.testing.assert_allclose(corners, [2, 1, 4, 3], atol=1e-3)
