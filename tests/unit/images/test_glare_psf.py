"""The point spread function holds all light once, looks alike at every resolution, and its star is the aperture's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from primray.arrays import Doubles
from primray.images import glare as star
from primray.images.glare import BLOOM_PARTS, bloom, build_psf, grid_of, veil
from primray.lens.diffusion import Diffusion

ALL_OF = {
    "glare": Diffusion(1.0, glare=1.0, starburst=0.0),
    "bloom": Diffusion(1.0, glare=0.0, starburst=0.0),
    "star": Diffusion(1.0, glare=0.0, starburst=1.0, starburst_width=0.01),
    "mixed": Diffusion(0.3),
    "wider than the frame": Diffusion(0.5, bloom_width=1.0, starburst_width=1.0),
    "narrower than a pixel": Diffusion(0.5, bloom_width=1e-4, starburst_width=1e-5),
}


@pytest.mark.parametrize("name", ALL_OF)
@pytest.mark.parametrize("aspect", [1.0, 2.0, 0.4])
def test_it_holds_all_light_once(name: str, aspect: float) -> None:
    psf = build_psf(ALL_OF[name], grid_of((64, 48), (64, 48), aspect), 5, 20.0)
    for channel in range(3):
        kernel = psf.whole(channel)
        assert kernel.shape == (95, 127)
        assert kernel.min() >= 0
        assert abs(kernel.sum() - 1.0) < 1e-13


def test_a_crop_has_the_frames() -> None:
    """And a window larger than the frame as well: the same weights at the same distances."""
    whole = build_psf(ALL_OF["mixed"], grid_of((64, 48), (64, 48)), 6).whole(1)
    crop = build_psf(ALL_OF["mixed"], grid_of((64, 48), (20, 10)), 6).whole(1)
    np.testing.assert_allclose(crop, whole[47 - 9 : 47 + 10, 63 - 19 : 63 + 20], rtol=1e-12)
    wider = build_psf(ALL_OF["mixed"], grid_of((64, 48), (128, 96)), 6).whole(1)
    np.testing.assert_allclose(wider[48:-48, 64:-64], whole, rtol=1e-12)
    assert abs(wider.sum() - 1.0) < 1e-13


@pytest.mark.parametrize("name", ["glare", "bloom", "star"])
def test_it_looks_alike_at_every_resolution(name: str) -> None:
    """Light within a tenth of the height, but for what the border's pixels hold of it."""
    shares = []
    for height in (61, 305):
        kernel = build_psf(ALL_OF[name], grid_of((height, height), (height, height))).whole(1)
        y, x = np.indices(kernel.shape) - (height - 1)
        shares.append(kernel[np.hypot(y, x) < 0.1 * height].sum())
    assert shares[0] == pytest.approx(shares[1], abs=0.02)


def test_the_bloom_is_gaussians() -> None:
    kernel = bloom(grid_of((400, 400), (400, 400)), 5.0)
    at = kernel[399, 399 + 12]
    density = sum(s / (2 * math.pi * (5 * k) ** 2) * math.exp(-(12**2) / (2 * (5 * k) ** 2)) for s, k in BLOOM_PARTS)
    assert at == pytest.approx(density, rel=0.01)


def test_the_veil_falls_with_the_square_of_the_distance() -> None:
    kernel = veil(grid_of((400, 400), (400, 400)), 1.0)[399]
    assert kernel[399 + 200] / kernel[399 + 100] == pytest.approx((101 / 201) ** 2, rel=1e-9)


def turned(pattern: Doubles, times: int) -> Doubles:
    """Light by angle, in as many parts, well outside of the core."""
    y, x = np.indices(pattern.shape) - star.PATTERN_SAMPLES // 2
    ring = (np.hypot(y, x) > 60) & (np.hypot(y, x) < 400)
    part = (np.arctan2(-y, x) / (2 * math.pi) * times % times).astype(int)
    found: Doubles = np.bincount(part[ring], pattern[ring], times) / np.bincount(part[ring], minlength=times)
    return found


@pytest.mark.parametrize(("blades", "arms"), [(6, 6), (8, 8), (5, 10), (7, 14)])
def test_the_star_has_an_arm_across_each_edge(blades: int, arms: int) -> None:
    """Twice as many where blades are odd: each edge throws light to both of its sides."""
    by_angle = turned(star._pattern(blades, 90.0 / arms), 8 * arms).reshape(arms, 8)
    assert (by_angle.max(axis=1) > 8 * np.median(by_angle)).all()
    np.testing.assert_allclose(by_angle.max(axis=1), by_angle.max(), rtol=0.5)


def test_the_star_turns_with_the_blades() -> None:
    """A corner at +X: the edges' normals, and arms, are at 30 degrees and every 60 from there."""
    by_angle = turned(star._pattern(6, 0.0), 36)
    bright = set(np.flatnonzero(by_angle > 4 * np.median(by_angle)))
    assert bright <= {2, 3, 8, 9, 14, 15, 20, 21, 26, 27, 32, 33}
    by_angle = turned(star._pattern(6, 10.0), 36)  # against the clock, as a picture's rows go down
    bright = set(np.flatnonzero(by_angle > 4 * np.median(by_angle)))
    assert bright <= {3, 4, 9, 10, 15, 16, 21, 22, 27, 28, 33, 34}


def test_without_blades_it_is_an_airy_disc() -> None:
    """Born and Wolf, 8.5.2: 83.8 % of the light within the first dark ring, at 1.22 wavelengths over diameters."""
    pattern = star._pattern(0, 0.0)
    y, x = (np.indices(pattern.shape) - star.PATTERN_SAMPLES // 2) * star.PATTERN_STEP
    assert pattern[np.hypot(y, x) < 1.22].sum() == pytest.approx(0.838, abs=0.01)
    dark = pattern[star.PATTERN_SAMPLES // 2, star.PATTERN_SAMPLES // 2 + 5] / pattern.max()  # at 1.25
    assert dark < 1e-3


def test_red_is_diffracted_farther() -> None:
    grid = grid_of((200, 200), (200, 200))
    y, x = np.indices(grid.shape) - 199
    red, green, blue = ((kernel * np.hypot(y, x)).sum() for kernel in star.starburst(grid, 1.0, 6, 0.0))
    assert red > green > blue
    assert red / blue == pytest.approx(611.4 / 464.2, rel=0.1)
