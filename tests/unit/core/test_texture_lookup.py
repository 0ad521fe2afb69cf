"""Texture lookups against plain double-precision arithmetic: orientation, wraps, bilinear weights, mip levels, storage."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from tests.described import kernels

from primray import core
from primray.description import Wrap

Floats = npt.NDArray[np.float32]
WRAPS = (Wrap.BLACK, Wrap.CLAMP, Wrap.REPEAT, Wrap.MIRROR)


def look(pixels: npt.ArrayLike, st: npt.ArrayLike, level: float = 0.0, wraps: tuple[Wrap, Wrap] = (Wrap.REPEAT,) * 2,
         first_level: int = 0, lanes: int = 0) -> Floats:  # fmt: skip
    p = np.asarray(pixels, np.float32)
    p = p if p.ndim == 3 else p[:, :, None]
    st = np.ascontiguousarray(np.atleast_2d(st), np.float32)
    levels = np.full(len(st), level, np.float32)
    wrap_s, wrap_t = (core.module().Wrap[w.name].value for w in wraps)
    return kernels().texture_lookup(p, wrap_s, wrap_t, first_level, st, levels, lanes).reshape(len(st), -1)


def centres(width: int, height: int) -> npt.NDArray[np.float64]:
    """st of all texels, (H, W, 2), first row at the top."""
    s, t = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    return np.stack([s, t], axis=-1)


def wrapped(wrap: Wrap, i: npt.NDArray[np.int64], size: int) -> npt.NDArray[np.int64]:
    """Texel indices of any integers."""
    if wrap is Wrap.REPEAT:
        return i % size
    if wrap is Wrap.MIRROR:
        return np.where(i % (2 * size) < size, i % (2 * size), 2 * size - 1 - i % (2 * size))
    return np.clip(i, 0, size - 1)


def reference(
    pixels: npt.NDArray[np.float64], st: npt.NDArray[np.float64], wraps: tuple[Wrap, Wrap]
) -> npt.NDArray[np.float64]:
    """Bilinear, (0, 0) at the lower left; black is nothing outside [0, 1], and clamps inside."""
    image = pixels[::-1]
    height, width = image.shape[:2]
    x, y = st[:, 0] * width - 0.5, st[:, 1] * height - 0.5
    x, y = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (st[:, 0] * width - 0.5 - x)[:, None], (st[:, 1] * height - 0.5 - y)[:, None]

    def at(i: npt.NDArray[np.int64], j: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        return image[wrapped(wraps[1], j, height), wrapped(wraps[0], i, width)]

    r = (at(x, y) * (1 - fx) + at(x + 1, y) * fx) * (1 - fy) + (at(x, y + 1) * (1 - fx) + at(x + 1, y + 1) * fx) * fy
    for k in range(2):
        if wraps[k] is Wrap.BLACK:
            r[(st[:, k] < 0) | (st[:, k] > 1)] = 0
    return r


def halved(pixels: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The next level: means over equal areas, as matrices."""

    def matrix(size: int) -> npt.NDArray[np.float64]:
        n = max(1, size // 2)
        edges = np.linspace(0, size, n + 1)
        cells = np.arange(size)
        overlap = np.minimum(edges[1:, None], cells + 1) - np.maximum(edges[:-1, None], cells)
        return np.maximum(overlap, 0) / (size / n)

    return np.einsum("ij,jkc,lk->ilc", matrix(pixels.shape[0]), pixels, matrix(pixels.shape[1]))


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (3, 5), (7, 4), (64, 48)])
@pytest.mark.parametrize("channels", [1, 3])
def test_texel_centres_are_exact(shape: tuple[int, int], channels: int) -> None:
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (*shape, channels)).astype(np.float32) / np.float32(255)
    st = centres(shape[1], shape[0]).reshape(-1, 2)
    np.testing.assert_allclose(look(pixels, st), pixels.reshape(-1, channels), atol=1e-6)


def test_the_first_row_is_at_the_top() -> None:
    pixels = [[0.0, 0.25], [0.5, 1.0]]
    st = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]]
    assert look(pixels, st).ravel().tolist() == [0.5, 1.0, 0.0, 0.25]


@pytest.mark.parametrize("wrap_s", WRAPS)
@pytest.mark.parametrize("wrap_t", WRAPS)
def test_wraps(wrap_s: Wrap, wrap_t: Wrap) -> None:
    rng = np.random.default_rng(1)
    pixels = rng.normal(size=(5, 6, 3)).astype(np.float32)
    st = rng.uniform(-3, 4, (4000, 2)).astype(np.float32)
    values = look(pixels, st, wraps=(wrap_s, wrap_t))
    wanted = reference(pixels.astype(np.float64), st.astype(np.float64), (wrap_s, wrap_t))
    np.testing.assert_allclose(values, wanted, atol=4e-3)  # half floats of 3 sigma
    assert np.abs(values - wanted).mean() < 3e-4


def test_black_is_sharp_and_exactly_nothing() -> None:
    st = [[-1e-6, 0.5], [0.0, 0.5], [1.0, 0.5], [1.000001, 0.5], [0.5, -0.1], [0.5, 1.1]]
    assert look(np.ones((4, 4)), st, wraps=(Wrap.BLACK,) * 2).ravel().tolist() == [0, 1, 1, 0, 0, 0]


def test_far_and_invalid_coordinates() -> None:
    st = [[1e30, -1e30], [np.nan, 0.5], [np.inf, -np.inf], [2.0**25, 0.5]]
    for wrap in WRAPS:
        values = look(np.full((3, 3), 0.5), st, wraps=(wrap, wrap))
        assert set(values.ravel().tolist()) <= {0.0, 0.5}


@pytest.mark.parametrize("shape", [(8, 8), (13, 7), (5, 1), (1, 9), (33, 30)])
def test_levels_are_means_over_equal_areas(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(2)
    level, pixels = 0, rng.random((*shape, 3)).astype(np.float32)
    coarse = pixels.astype(np.float64)
    while coarse.shape[:2] != (1, 1):
        level, coarse = level + 1, halved(coarse)
        st = centres(coarse.shape[1], coarse.shape[0]).reshape(-1, 2)
        np.testing.assert_allclose(look(pixels, st, level), coarse.reshape(-1, 3), rtol=1e-3)
    np.testing.assert_allclose(look(pixels, [[0.3, 0.8]], 50)[0], pixels.mean(axis=(0, 1)), rtol=6e-4)


def test_between_levels() -> None:
    rng = np.random.default_rng(3)
    pixels, st = rng.random((16, 16)), rng.random((100, 2))
    fine, coarse = (look(pixels, st, level) for level in (1, 2))
    np.testing.assert_allclose(look(pixels, st, 1.25), 0.75 * fine + 0.25 * coarse, rtol=1e-5)
    np.testing.assert_array_equal(look(pixels, st, -3), look(pixels, st, 0))


def test_dropped_levels_leave_the_others_alone() -> None:
    rng = np.random.default_rng(4)
    pixels, st = rng.random((40, 24)), rng.random((100, 2))
    for level in (2, 3.5, 9):
        np.testing.assert_array_equal(look(pixels, st, level, first_level=2), look(pixels, st, level))
    np.testing.assert_array_equal(look(pixels, st, 0, first_level=2), look(pixels, st, 2))


def test_lanes_do_not_change_bits() -> None:
    rng = np.random.default_rng(5)
    for pixels in (rng.normal(size=(9, 11, 3)), rng.random((9, 11)), 1e6 * rng.random((9, 11, 3))):
        st = rng.uniform(-2, 3, (1003, 2))
        for level in (0, 1.3):
            for wrap in WRAPS:
                one, most = (look(pixels, st, level, (wrap, wrap), lanes=lanes) for lanes in (1, 0))
                assert np.array_equal(one, most)


@pytest.mark.parametrize(
    ("values", "error"),
    [
        (np.arange(256, dtype=np.float32) / np.float32(255), 0.0),  # what 8 bits hold
        (np.arange(0, 65536, 7, dtype=np.float32) / np.float32(65535), 0.0),  # 16 bits
        (np.array([-1, 1, 0.5, -0.25, 2048, 65504, 2.0**-24, 3 * 2.0**-20, -(2.0**-14)], np.float32), 0.0),  # half floats
        (np.array([1e6, -1e30, 1e-30, 3.14159], np.float32), 0.0),  # neither: kept whole
        (np.random.default_rng(6).random(5000, np.float32) * 40, 2.0**-11),  # rounded: half an ulp of 11 bits
        (np.random.default_rng(7).random(5000, np.float32) * 1e-4, 2.0**-11),
    ],
)
def test_storage(values: Floats, error: float) -> None:
    # Every value three texels wide, so that rounding of the coordinate finds no other.
    read = look(np.repeat(values, 3)[None], centres(len(values), 1).reshape(-1, 2)).ravel()
    assert (np.abs(read - values) <= error * np.abs(values) + (2.0**-25 if error else 0)).all()
    assert (read != values).any() == (error > 0)
