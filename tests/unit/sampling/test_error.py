"""Intervals of error estimates."""

from __future__ import annotations

import pytest

from primray.sampling.error import Estimate


def test_intervals_are_positive_and_hold_their_value() -> None:
    e = Estimate.around(2.0, 0.1)
    assert 0 < e.low < e.value < e.high
    assert e.root().value == pytest.approx(2**0.5)
    assert Estimate.around(1.0, 1e9).high < float("inf")
