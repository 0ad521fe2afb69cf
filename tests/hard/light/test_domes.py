"""Domes with images that no camera took, against quadrature over their texels."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from .lit_stages import Shown, camera_at, dome, irradiance, show, write_image

Measured = Callable[[str], None]
Doubles = npt.NDArray[np.float64]


def lit_by(image: npt.ArrayLike, path: Path, *inputs: str, spp: int = 1024) -> Shown:
    return irradiance(dome(f"asset inputs:texture:file = {write_image(path / 'sky.exr', image)}", *inputs), spp=spp)


def quadrature(image: Doubles) -> float:
    """Irradiance of a facing-up point under the bilinearly read image: over longitude the mean of a row's texels, over latitude
    by midpoints."""
    h = image.shape[0]
    steps = 16 * max(h, 1024)
    theta = (np.arange(steps) + 0.5) / steps * math.pi
    t = theta / math.pi * h - 0.5
    rows, mean = np.floor(t).astype(int), image[..., 0].mean(axis=1)
    radiance = mean[np.clip(rows, 0, h - 1)] * (rows + 1 - t) + mean[np.clip(rows + 1, 0, h - 1)] * (t - rows)
    return float((radiance * np.maximum(np.cos(theta), 0) * np.sin(theta)).sum() * 2 * math.pi * math.pi / steps)


def spot(row: int, column: int, value: float, rest: float = 0.0, shape: tuple[int, int] = (64, 128)) -> Doubles:
    image = np.full((*shape, 3), rest)
    image[row, column] = value
    return image


SPOTS = {
    "high": spot(5, 30, 1e6),
    "high, on a sky of 1": spot(5, 30, 1e6, 1.0),
    "at the pole": spot(0, 30, 1e6, 1.0),
    "at the horizon": spot(31, 30, 1e6),
    "across the seam": spot(20, 0, 1e6),
    "below the horizon": spot(63, 30, 1e6, 1.0),
    "in one row": spot(0, 7, 1e6, 1.0, (1, 4096)),
    "in one column": spot(7, 0, 1e6, 1.0, (4096, 1)),
}


@pytest.mark.parametrize("name", SPOTS)
@pytest.mark.hard_case(
    "Lights", "a dome with one pixel of 1e6: %s", expected="the quadrature, to five standard errors",
    plain_float="without its distribution one ray in 8192 finds it",
)  # fmt: skip
def test_one_bright_pixel(name: str, tmp_path: Path, measured: Measured) -> None:
    found, wanted = lit_by(SPOTS[name], tmp_path), quadrature(SPOTS[name])
    assert abs(found.mean - wanted) < 5 * found.noise + 1e-4 * wanted
    assert found.noise < 0.01 * wanted
    assert not found.noted
    measured(f"{found.mean / wanted:.2f} of it")


@pytest.mark.hard_case("Lights", "a dome of 1 x 1 texels", expected="constant: pi, without noise")
def test_one_texel(tmp_path: Path, measured: Measured) -> None:
    found = lit_by(np.ones((1, 1, 3)), tmp_path, spp=4)
    np.testing.assert_allclose(found.pixels, math.pi, rtol=1e-6)
    measured("pi, without noise")


@pytest.mark.hard_case("Lights", "a black dome", expected="black, nothing added")
def test_black(tmp_path: Path, measured: Measured) -> None:
    found = lit_by(np.zeros((8, 16, 3)), tmp_path, spp=4)
    assert not found.pixels.any()
    assert not found.noted
    measured("black")


@pytest.mark.hard_case(
    "Lights", "a dome with NaN, Inf and negative texels", expected="they are 0; a diagnostic with their number",
    plain_float="one NaN texel blackens the distribution, or every pixel",
)  # fmt: skip
def test_bad_texels(tmp_path: Path, measured: Measured) -> None:
    image, clean = np.ones((2, 32, 64, 3))
    image[3, 3], image[4, 4, 0], image[5, 5, 1], image[6, 6] = np.nan, np.inf, -2.0, -np.inf
    image[20, 9, 2] = np.nan
    for row, column in ((3, 3), (4, 4), (6, 6), (20, 9)):
        clean[row, column] = 0  # the whole texel
    clean[5, 5, 1] = 0  # a colour beyond the space's: what it lacks alone
    found = lit_by(image, tmp_path)
    assert set(found.noted) == {"texture-bad-texels"}
    assert found.noted["texture-bad-texels"].startswith("5 texels")
    assert found.invalid_samples == 0
    seen = show(dome(f"asset inputs:texture:file = {write_image(tmp_path / 'seen.exr', image)}"), camera_at(0.0, 1.0))
    assert seen.pixels.min() >= 0
    for channel in range(3):
        near = quadrature(clean[..., channel : channel + 1])
        got = found.pixels[..., channel]
        assert abs(got.mean() - near) < 5 * got.std() / 8 + 1e-3 * near
    measured("5 texels read as 0")


@pytest.mark.hard_case("Lights", "a dome of 1e38, times an intensity of 100", expected="finite, and a diagnostic")
def test_too_bright(tmp_path: Path, measured: Measured) -> None:
    found = lit_by(np.full((4, 8, 3), 1e38), tmp_path, "float inputs:intensity = 100", spp=4)
    assert set(found.noted) == {"texture-bad-texels"}
    assert found.invalid_samples == 0
    np.testing.assert_allclose(found.pixels, math.pi * 1e17, rtol=1e-5)
    measured("1e15 for each texel, texture-bad-texels")
