"""The accuracies that math/transcendental.hpp states, against double precision."""

from __future__ import annotations

import numpy as np
from tests.described import kernels


def first_of_two(x: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.stack([x, np.zeros_like(x)], axis=1), np.float32)


def test_sincos_turns() -> None:
    for reach in (1.0, 100.0):
        u = np.linspace(-reach, reach, 400_001).astype(np.float32)
        exact = 2 * np.pi * u.astype(np.float64)
        got = kernels().sincos_turns(first_of_two(u)).astype(np.float64)
        assert np.abs(got[:, 0] - np.sin(exact)).max() < 2e-7
        assert np.abs(got[:, 1] - np.cos(exact)).max() < 2e-7


def test_acos() -> None:
    x = np.concatenate([np.linspace(-1, 1, 400_001), 1 - np.logspace(-8, -1, 1000), [1.5, -1.5]]).astype(np.float32)
    got = kernels().acos(first_of_two(x)).astype(np.float64)
    assert np.abs(got - np.arccos(np.clip(x.astype(np.float64), -1, 1))).max() < 4e-7
    # Small angles keep their digits.
    near = np.nextafter(np.float32(1), np.float32(0))
    assert abs(kernels().acos(first_of_two(np.array([near])))[0] / np.arccos(np.float64(near)) - 1) < 1e-6


def test_atan2() -> None:
    a = np.linspace(-np.pi, np.pi, 400_001)
    for r in (1e-20, 1.0, 1e20):
        yx = (r * np.stack([np.sin(a), np.cos(a)], axis=1)).astype(np.float32)
        exact = np.arctan2(*yx.astype(np.float64).T)
        assert np.abs(kernels().atan2(yx).astype(np.float64) - exact).max() < 1e-6
    special = np.array([[0, 0], [0, 1], [0, -1], [1, 0], [-1, 0]], np.float32)
    np.testing.assert_allclose(kernels().atan2(special), [0, 0, np.pi, np.pi / 2, -np.pi / 2], atol=1e-6)


def test_exp2() -> None:
    x = np.linspace(-126, 126, 400_001).astype(np.float32)
    got = kernels().exp2(first_of_two(x)).astype(np.float64)
    assert np.abs(got / np.exp2(x.astype(np.float64)) - 1).max() < 3e-7
    assert (kernels().exp2(first_of_two(np.array([-127.5, -1e3, -1e38, -np.inf]))) == 0).all()


def test_log2_cosine() -> None:
    a = np.concatenate([np.logspace(-18, np.log10(np.pi / 2 - 1e-6), 100_001), np.linspace(0.01, 3.1, 100_001)])
    cs = np.stack([np.cos(a), np.sin(a)], axis=1).astype(np.float32)
    c, s = cs.astype(np.float64).T
    exact = np.where(np.abs(c) > 0.84, 0.5 * np.log1p(-np.minimum(s * s, 0.5)), np.log(np.abs(c))) / np.log(2)
    got = kernels().log2_cosine(cs).astype(np.float64)
    assert np.abs(got / exact - 1).max() < 1e-6
    assert -124 < kernels().log2_cosine(np.array([[0, 1]], np.float32))[0] < -122
    assert kernels().log2_cosine(np.array([[1, 0]], np.float32))[0] == 0


def test_lanes_do_not_change_bits() -> None:
    x = np.random.default_rng(0).normal(size=(1003, 2)).astype(np.float32)
    for f in (kernels().sincos_turns, kernels().acos, kernels().atan2, kernels().concentric_disk, kernels().log2_cosine):
        assert np.array_equal(f(x, 1), f(x), equal_nan=True)
