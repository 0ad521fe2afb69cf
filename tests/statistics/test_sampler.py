"""Sample numbers: nets in every dimension pair, independent of one another across pixels, replicates, bounces and purposes."""

from __future__ import annotations

import numpy as np
import pytest
from tests.described import kernels

PURPOSES = 7
N = 4096
# |r| of N independent pairs exceeds 4.9 / sqrt(N) with probability 1e-6.
BOUND = 4.9 / np.sqrt(N)


def numbers(
    seed: int = 0, x: int = 3, y: int = 5, replicate: int = 0, bounce: int = 1, purpose: int = 2, n: int = N
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (n, 2) and singles (n,) of indices 0 to n - 1."""
    key = np.tile(np.array([x, y, replicate, 0, bounce, purpose], np.int32), (n, 1))
    key[:, 3] = np.arange(n)
    return kernels().sampler_numbers(seed, key)


def is_net(points: np.ndarray) -> bool:
    """One point in every elementary interval (Sobol 1967): widths 2^-a by 2^-(k - a)."""
    n = len(points)
    k = n.bit_length() - 1
    for a in range(k + 1):
        cell = (points[:, 0] * 2**a).astype(int) * 2 ** (k - a) + (points[:, 1] * 2 ** (k - a)).astype(int)
        if len(np.unique(cell)) != n:
            return False
    return True


@pytest.mark.parametrize("purpose", range(PURPOSES))
def test_prefixes_are_nets(purpose: int) -> None:
    for seed, x, y, replicate, bounce in ((0, 0, 0, 0, 0), (1, 7, 9, 1, 1), (2**32 - 1, 4095, 2159, 0, 63)):
        pairs, singles = numbers(seed, x, y, replicate, bounce, purpose, 1024)
        assert pairs.min() >= 0
        assert pairs.max() < 1
        for k in range(11):
            assert is_net(pairs[: 2**k]), (seed, k)
            assert len(np.unique((singles[: 2**k] * 2**k).astype(int))) == 2**k


def test_a_wrong_net_is_noticed() -> None:
    pairs, _ = numbers(n=256)
    pairs = pairs.copy()
    pairs[17, 0] = (pairs[17, 0] + 0.5) % 1
    assert not is_net(pairs)


def test_independent_of_all_else() -> None:
    """Correlations of integrands between any two dimensions, pixels or replicates, at the same index."""
    base = {"seed": 0, "x": 3, "y": 5, "replicate": 0, "bounce": 1, "purpose": 2}
    changes = [{"seed": 1}, {"x": 4}, {"x": 2}, {"y": 6}, {"x": 5, "y": 3}, {"x": 19}, {"replicate": 1}]
    changes += [{"bounce": b} for b in (0, 2, 3, 17)] + [{"purpose": p} for p in range(PURPOSES) if p != 2]
    u, s = numbers(**base)
    for change in changes:
        v, t = numbers(**(base | change))
        for a in (u[:, 0], u[:, 1], s):
            for b in (v[:, 0], v[:, 1], t):
                for power in (1, 2):
                    r = np.corrcoef((a - 0.5) ** power, (b - 0.5) ** power)[0, 1]
                    assert abs(r) < BOUND, change


def test_errors_of_pixels_and_replicates_are_independent() -> None:
    """Means of 16 samples of one function: their errors do not go together from pixel to pixel or replicate to replicate."""
    side = 48
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    error = np.zeros((2, side, side))
    for replicate in (0, 1):
        key = np.zeros((side * side * 16, 6), np.int32)
        key[:, 0], key[:, 1] = np.repeat(x.ravel(), 16), np.repeat(y.ravel(), 16)
        key[:, 2], key[:, 3], key[:, 4], key[:, 5] = replicate, np.tile(np.arange(16), side * side), 1, 4
        pairs, _ = kernels().sampler_numbers(9, key)
        values = np.exp(pairs[:, 0]) * np.cos(3 * pairs[:, 1])
        error[replicate] = values.reshape(side, side, 16).mean(axis=2) - (np.e - 1) * np.sin(3) / 3
    bound = 4.9 / np.sqrt(side * side)
    assert abs(np.corrcoef(error[0].ravel(), error[1].ravel())[0, 1]) < bound
    for e in error:
        assert abs(np.corrcoef(e[:, 1:].ravel(), e[:, :-1].ravel())[0, 1]) < bound
        assert abs(np.corrcoef(e[1:].ravel(), e[:-1].ravel())[0, 1]) < bound
        # Unbiased: five standard errors.
        assert abs(e.mean()) < 5 * e.std() / side


def test_lanes_do_not_change_bits() -> None:
    rng = np.random.default_rng(1)
    key = np.stack([rng.integers(0, high, 1001) for high in (4000, 4000, 2, 100000, 40, PURPOSES)], axis=1).astype(np.int32)
    for one, many in zip(kernels().sampler_numbers(5, key, 1), kernels().sampler_numbers(5, key), strict=True):
        assert np.array_equal(one, many)
