"""Intervals of error estimates."""

from __future__ import annotations

import math

import pytest

from primray.sampling.error import Estimate, student_quantile


def test_intervals_are_positive_and_hold_their_value() -> None:
    e = Estimate.around(2.0, 0.1)
    assert 0 < e.low < e.value < e.high
    assert e.root().value == pytest.approx(2**0.5)
    assert Estimate.around(1.0, 1e9).high < float("inf")


def test_errors_of_few_pixels_may_be_larger_than_they_may_be_smaller() -> None:
    few, many = Estimate.of_replicates(2.0, 0.4), Estimate.of_replicates(2.0, 0.001)
    assert few.low == Estimate.around(2.0, 0.4).low
    assert few.high == pytest.approx(2 * math.exp(0.4 * student_quantile(4 / 0.4**2 / 12)))
    assert few.high / few.value > 1.2 * few.value / few.low
    assert many.high == pytest.approx(Estimate.around(2.0, 0.001).high, rel=1e-6)
    assert few.deviation == pytest.approx(0.4)
    assert Estimate.of_replicates(1.0, 1e9).high < float("inf")
    assert Estimate.of_replicates(1.0, 0.0) == Estimate(1.0, 1.0, 1.0)


def test_a_render_stops_by_the_lower_end() -> None:
    """The upper end is wider for few pixels; how many samples a target takes stays as it is."""
    assert Estimate.of_replicates(1.0, 0.5).doubt == pytest.approx(Estimate.around(1.0, 0.5).doubt)
