"""Sample numbers: nets in every dimension pair, independent of one another across pixels, replicates, bounces and purposes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from tests.described import kernels

PURPOSES = 8
CHAIN = 2  # its rows name a link in place of a bounce
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


def boxes_with_one_point(points: np.ndarray) -> float:
    """Of all boxes of 1 / n in four dimensions with sides 4^-d (n = 4^m points), the least share that holds a point."""
    n = len(points)
    m = (n.bit_length() - 1) // 2
    least = 1.0
    for sides in itertools.product(range(m + 1), repeat=4):
        if sum(sides) == m:
            cell = np.zeros(n, int)
            for column, d in zip(points.T, sides, strict=True):
                cell = cell * 4**d + (column * 4**d).astype(int)
            least = min(least, len(np.unique(cell)) / n)
    return least


def test_links_of_the_chain_are_nets_by_two() -> None:
    for seed, x, y, replicate in ((0, 0, 0, 0), (1, 7, 9, 1), (2**32 - 1, 4095, 2159, 0)):
        links = [numbers(seed, x, y, replicate, link, CHAIN, 256)[0] for link in range(8)]
        for k in range(0, 8, 2):
            for n in (4, 16, 64, 256):
                assert boxes_with_one_point(np.hstack(links[k : k + 2])[:n]) == 1, (seed, k, n)
        # Others are not: neither the next two nor pairs of other purposes.
        assert boxes_with_one_point(np.hstack(links[1:3])) < 1
        assert boxes_with_one_point(np.hstack([links[0], numbers(seed, x, y, replicate, 1, 4, 256)[0]])) < 1


def test_independent_of_all_else() -> None:
    """Correlations of integrands between any two dimensions, pixels or replicates, at the same index."""
    base = {"seed": 0, "x": 3, "y": 5, "replicate": 0, "bounce": 1, "purpose": 4}
    changes = [{"seed": 1}, {"x": 4}, {"x": 2}, {"y": 6}, {"x": 5, "y": 3}, {"x": 19}, {"replicate": 1}]
    changes += [{"bounce": b} for b in (0, 2, 3, 17)] + [{"purpose": p} for p in range(PURPOSES) if p != 4]
    check_independence(base, changes)


def test_links_are_independent() -> None:
    """Of each other, and of the purposes of all bounces."""
    base = {"seed": 0, "x": 3, "y": 5, "replicate": 0, "bounce": 1, "purpose": CHAIN}
    changes = [{"x": 4}, {"replicate": 1}] + [{"bounce": b} for b in (0, 2, 3, 4, 17)]
    changes += [{"bounce": b, "purpose": p} for b in (0, 1) for p in range(PURPOSES) if p != CHAIN]
    check_independence(base, changes)


def check_independence(base: dict[str, int], changes: list[dict[str, int]]) -> None:
    columns = used_numbers(base)
    for change in changes:
        for a in columns:
            for b in used_numbers(base | change):
                for power in (1, 2):
                    r = np.corrcoef((a - 0.5) ** power, (b - 0.5) ** power)[0, 1]
                    assert abs(r) < BOUND, change


def used_numbers(key: dict[str, int]) -> list[np.ndarray]:
    """Both numbers of the pair, and the single one where there is any: the chain has none."""
    pair, single = numbers(**key)
    return [pair[:, 0], pair[:, 1]] + ([single] if key["purpose"] != CHAIN else [])


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


@pytest.mark.parametrize("block", [1, 2])
@pytest.mark.parametrize("replicate", [0, 1])
def test_squares_of_pixels_share_a_net_on_the_screen(block: int, replicate: int) -> None:
    for side, x0, y0 in ((2, 6, 4), (4, 12, 40), (16, 1600, 0), (32, 32, 32768 - 32)):
        x, y = (column.ravel() for column in np.meshgrid(x0 + np.arange(side), y0 + np.arange(side)))
        for purpose in (CHAIN, 4):
            key = np.zeros((side * side * block, 6), np.int32)
            key[:, 0], key[:, 1], key[:, 2] = np.repeat(x, block), np.repeat(y, block), replicate
            key[:, 3], key[:, 4], key[:, 5] = np.tile(np.arange(block), side * side), 1, purpose
            assert is_net(kernels().sampler_numbers(3, key, screen_block=block)[0]), (side, purpose)
            assert not is_net(kernels().sampler_numbers(3, key)[0]), (side, purpose)


def test_replicates_on_the_screen_are_independent() -> None:
    side = 64
    x, y = (column.ravel() for column in np.meshgrid(np.arange(side), np.arange(side)))
    key = np.zeros((side * side, 6), np.int32)
    key[:, 0], key[:, 1], key[:, 4], key[:, 5] = x, y, 1, 4
    pairs = []
    for replicate in (0, 1):
        key[:, 2] = replicate
        pairs.append(kernels().sampler_numbers(9, key, screen_block=1)[0])
    for a in pairs[0].T:
        for b in pairs[1].T:
            assert abs(np.corrcoef(a, b)[0, 1]) < 4.9 / side


def test_lanes_do_not_change_bits() -> None:
    rng = np.random.default_rng(1)
    key = np.stack([rng.integers(0, high, 1001) for high in (4000, 4000, 2, 100000, 40, PURPOSES)], axis=1).astype(np.int32)
    for block in (0, 2):
        one, many = (kernels().sampler_numbers(5, key, *lanes, screen_block=block) for lanes in ((1,), ()))
        assert all(np.array_equal(a, b) for a, b in zip(one, many, strict=True))
