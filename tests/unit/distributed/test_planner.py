"""Ranges are handed out once, in order, and never across a number of samples at which the error is measured."""

from __future__ import annotations

import numpy as np
import pytest

from primray.distributed.planner import AssignedRanges


def test_ranges_follow_one_another() -> None:
    board = AssignedRanges()
    found = []
    while (part := board.next_part(40, 40, 16)) is not None:
        board.take(part)
        found.append(part)
    assert found == [(0, 16), (16, 32), (32, 40)]


def test_what_was_given_back_comes_first() -> None:
    board = AssignedRanges()
    for part in ((0, 8), (8, 20), (20, 40)):
        board.take(part)
    board.give_back((8, 20))
    assert board.left(40) == 12
    assert board.next_part(64, 64, 100) == (8, 20)
    assert board.next_part(64, 64, 4) == (8, 12)


def test_no_part_crosses_the_goal_or_an_anchor_beyond_it() -> None:
    board = AssignedRanges()
    board.take((0, 90))
    assert board.next_part(100, 200, 64) == (90, 100)
    board.take((90, 100))
    assert board.next_part(100, 200, 64) == (100, 128)
    board.take((100, 128))
    assert board.next_part(100, 200, 64) == (128, 192)
    assert board.across(110) == [(100, 128)]
    assert board.across(100) == []


@pytest.mark.parametrize("seed", range(5))
def test_all_samples_are_rendered_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    board = AssignedRanges()
    held: list[tuple[int, int]] = []
    for _ in range(1000):
        if held and rng.random() < 0.3:
            board.give_back(held.pop(int(rng.integers(len(held)))))
        elif (part := board.next_part(50, 100, 2 * int(rng.integers(1, 8)))) is not None:
            board.take(part)
            held.append(part)
        counts = np.zeros(100, int)
        for a, b in held:
            counts[a:b] += 1
        assert counts.max() <= 1
        assert board.left(100) == (counts == 0).sum()
