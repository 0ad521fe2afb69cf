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


def test_lanes_do_not_change_bits() -> None:
    x = np.random.default_rng(0).normal(size=(1003, 2)).astype(np.float32)
    for f in (kernels().sincos_turns, kernels().acos, kernels().atan2, kernels().concentric_disk):
        assert np.array_equal(f(x, 1), f(x), equal_nan=True)
