"""Reductions of long arrays of short rows give what NumPy's own give."""

from __future__ import annotations

import numpy as np
import pytest

from primray.arrays import chosen_rows, extremes, finite_rows


@pytest.mark.parametrize("count", [1, 2, 255, 511, 512, 513, 1000, 5000])
@pytest.mark.parametrize("columns", [1, 3, 4])
def test_extremes(count: int, columns: int) -> None:
    rng = np.random.default_rng(count + columns)
    for at in (0, count // 2, count - 1):
        rows = rng.normal(size=(count, columns)).astype(np.float32)
        rows[at] = 9 + np.arange(columns)
        for some in (rows, -rows, np.asfortranarray(rows), rows[::2]):
            for found, expected in zip(extremes(some), (some.min(axis=0), some.max(axis=0)), strict=True):
                np.testing.assert_array_equal(found, expected)


def test_extremes_of_what_is_no_number() -> None:
    rows = np.zeros((2000, 3), np.float32)
    rows[1500, 1] = np.nan
    low, high = extremes(rows)
    np.testing.assert_array_equal(np.isnan([low, high]), [[False, True, False]] * 2)


def test_finite_rows() -> None:
    rows = np.zeros((4, 3))
    assert finite_rows(rows).tolist() == [True] * 4
    rows[1, 2], rows[3, 0] = np.inf, np.nan
    assert finite_rows(rows).tolist() == [True, False, True, False]


def test_chosen_rows() -> None:
    rows = np.arange(12).reshape(4, 3)
    np.testing.assert_array_equal(chosen_rows(rows, np.array([2, 0, 2])), rows[[2, 0, 2]])
    np.testing.assert_array_equal(chosen_rows(rows, np.array([True, False, False, True])), rows[[0, 3]])
