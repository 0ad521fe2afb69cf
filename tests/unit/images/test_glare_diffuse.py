"""Pictures spread: a point becomes the function, light is neither made nor lost inside, and errors are those of the sums."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from primray.arrays import Floats
from primray.images.glare import Convolver, PointSpreadFunction, build_psf, diffuse, fast_length, grid_of, spread_by
from primray.images.image import Image
from primray.lens.diffusion import Diffusion

from ..conftest import make_camera

SIZE = WIDTH, HEIGHT = 37, 23


def function(strength: float = 0.4) -> PointSpreadFunction:
    return build_psf(Diffusion(strength, bloom_width=0.05, starburst_width=0.02), grid_of(SIZE, SIZE), 6)


def picture(seed: int = 3) -> Floats:
    return np.random.default_rng(seed).exponential(size=(HEIGHT, WIDTH, 4)).astype(np.float32)


def test_a_point_becomes_the_function() -> None:
    psf, pixels = function(), np.zeros((HEIGHT, WIDTH, 4), np.float32)
    pixels[11, 18] = 1.0
    found, _ = spread_by(psf, pixels, None)
    for channel in range(3):
        np.testing.assert_allclose(found[..., channel], psf.whole(channel)[11:34, 18:55], rtol=1e-6, atol=1e-12)


def test_it_is_the_sum_over_all_pixels() -> None:
    """Nothing comes from beyond the edges, and what goes there is lost."""
    psf, pixels = function(), picture()
    found, _ = spread_by(psf, pixels, None)
    for i, j in ((0, 0), (22, 36), (5, 30)):
        about = psf.whole(0)[::-1, ::-1][HEIGHT - 1 - i : 2 * HEIGHT - 1 - i, WIDTH - 1 - j : 2 * WIDTH - 1 - j]
        assert found[i, j, 0] == pytest.approx((about * pixels[..., 0]).sum(), rel=1e-6)


def test_light_well_inside_stays() -> None:
    """The window is three frames wide, so that all that the light of the middle one comes to is in it."""
    pixels = np.zeros((3 * HEIGHT, 3 * WIDTH, 4), np.float32)
    pixels[HEIGHT : 2 * HEIGHT, WIDTH : 2 * WIDTH] = picture()
    psf = build_psf(Diffusion(0.7, glare=0.5), grid_of(SIZE, (3 * WIDTH, 3 * HEIGHT)))
    found, _ = spread_by(psf, pixels, None)
    sums = (pixels[..., :3].sum((0, 1), np.float64), found[..., :3].sum((0, 1), np.float64))
    np.testing.assert_allclose(sums[1] / sums[0], 1.0, atol=1e-6)
    assert (found != pixels).any()


def test_alpha_stays() -> None:
    pixels = picture()
    assert (spread_by(function(), pixels, None)[0][..., 3] == pixels[..., 3]).all()


def test_errors_are_those_of_the_sums() -> None:
    psf, stderr = function(), np.abs(picture(4)[..., :3])
    _, found = spread_by(psf, picture(), stderr)
    assert found is not None
    for channel in range(3):
        about = psf.whole(channel)[::-1, ::-1][11 : 11 + HEIGHT, 18 : 18 + WIDTH]
        exact = np.sqrt((about**2 * stderr[..., channel].astype(np.float64) ** 2).sum())
        assert found[HEIGHT - 1 - 11, WIDTH - 1 - 18, channel] == pytest.approx(exact, rel=1e-6)


def test_errors_are_those_of_many_pictures() -> None:
    psf, stderr = function(), np.abs(picture(4)[..., :3])
    means, random = picture(), np.random.default_rng(5)
    seen = []
    for _ in range(600):
        noisy = means.copy()
        noisy[..., :3] += random.standard_normal(stderr.shape).astype(np.float32) * stderr
        seen.append(spread_by(psf, noisy, None)[0][..., :3])
    _, told = spread_by(psf, means, stderr)
    assert told is not None
    ratio = np.var(seen, axis=0, ddof=1) / np.square(told)
    assert ratio.mean() == pytest.approx(1.0, abs=0.02)
    assert np.sqrt(np.mean((ratio - 1) ** 2)) == pytest.approx(np.sqrt(2 / 599), rel=0.15)


def test_an_unknown_error_makes_all_unknown() -> None:
    stderr = np.ones((HEIGHT, WIDTH, 3), np.float32)
    stderr[3, 4, 1] = np.inf
    _, found = spread_by(function(), picture(), stderr)
    assert found is not None
    assert np.isinf(found[..., 1]).all()
    assert np.isfinite(found[..., ::2]).all()


def test_values_that_are_not_finite_spread_nothing() -> None:
    pixels = picture()
    pixels[3, 4] = np.inf
    found, _ = spread_by(function(), pixels, None)
    assert (~np.isfinite(found)).sum() == 4


def test_dark_beside_bright_is_not_below_black() -> None:
    pixels = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    pixels[2, 2] = 1e12
    assert spread_by(build_psf(Diffusion(0.1, glare=0.0, starburst=0.0), grid_of(SIZE, SIZE)), pixels, None)[0].min() >= 0


def test_an_image_keeps_its_record() -> None:
    camera = replace(make_camera(), blades=5, lens_radius=0.1, focus_distance=1.0)
    image = Image(picture(), camera=camera, errors=picture()[..., :3])
    made, says = diffuse(image, Diffusion(0.25))
    assert (image.pixels == picture()).all()
    assert (made.pixels != image.pixels)[..., :3].all()
    assert says["blades"] == 5
    assert all(0 < moved < 0.25 for moved in says["light_moved"])
    before, after = (image.pixels[..., 0].sum(dtype=np.float64), made.pixels[..., 0].sum(dtype=np.float64))
    assert says["light_lost"][0] == pytest.approx(1 - after / before)
    assert diffuse(image, Diffusion(0.25, blades=7))[1]["blades"] == 7


def test_fast_lengths() -> None:
    for least in (1, 2, 7, 11, 13, 97, 101, 2159, 3839):
        found = fast_length(least)
        assert found >= least
        for prime in (2, 3, 5):
            while found % prime == 0:
                found //= prime
        assert found == 1
    assert [fast_length(n) for n in (7, 11, 17, 2159)] == [8, 12, 18, 2160]


def test_one_pixel() -> None:
    convolver = Convolver(1, 1)
    assert convolver.spread(np.array([[3.0]]), convolver.spectrum(np.array([[0.5]])))[0, 0] == pytest.approx(1.5)
