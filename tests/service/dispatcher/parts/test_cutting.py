"""How a frame is cut: all samples once, the last parts short, none beyond what is asked for."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from primray.settings import SAMPLE_BLOCK
from primray_service.dispatcher.frames.parts.cutting import (
    AHEAD,
    FIRST,
    LEAST,
    Known,
    Rules,
    expected_end,
    next_samples,
    rules_of,
)


def cut(rules: Rules, known: Known) -> list[int]:
    sizes: list[int] = []
    while size := next_samples(sum(sizes), rules, known):
        sizes.append(size)
    return sizes


@given(st.integers(4, 4096), st.integers(2, 64), st.one_of(st.none(), st.floats(1e-4, 1e3)), st.floats(0, 100))
def test_parts_are_all_samples_and_the_last_are_short(most: int, places: int, sample_s: float | None, load_s: float) -> None:
    rules = rules_of({"max_samples": most})
    sizes = cut(rules, Known(places, sample_s=sample_s, load_s=load_s))
    assert sum(sizes) == rules.most == most // SAMPLE_BLOCK * SAMPLE_BLOCK
    assert all(size % SAMPLE_BLOCK == 0 for size in sizes)
    assert all(later <= earlier + LEAST for earlier, later in itertools.pairwise(sizes))
    if most >= 16 * places and sample_s is None:
        assert sizes[-1] <= 2 * LEAST


def test_nothing_is_given_out_beyond_the_error_that_is_expected() -> None:
    rules = rules_of({"target_error": 0.01})
    assert next_samples(0, rules, Known(4)) == FIRST
    for sample_s in (None, 1e-6, 10.0):
        assert sum(cut(rules, Known(4, sample_s=sample_s))) == AHEAD * 4 * FIRST  # until there is a measurement
    at_32 = Known(4, merged=32, error=0.02)
    end = expected_end(rules, at_32)
    assert end == 66
    assert 0 < next_samples(32, rules, at_32) < end - 32
    assert next_samples(end, rules, at_32) == 0
    rmse = rules_of({"target_error": 0.01, "metric": "rmse", "max_samples": 100})
    assert expected_end(rmse, at_32) == 100  # four times as many would be 131


def test_a_frame_that_is_at_its_target_by_too_few_samples_takes_some_more() -> None:
    rules = rules_of({"target_error": 0.5})
    assert next_samples(8, rules, Known(2, merged=8, error=0.1)) == LEAST


@pytest.mark.parametrize(
    ("left_s", "sample_s", "samples"),
    [(10.0, None, LEAST), (10.0, 0.1, 50), (1.0, 0.1, 6), (0.1, 0.1, 0), (0.0, None, 0), (-1.0, 0.1, 0)],
)
def test_a_time_limit_makes_parts_short(left_s: float, sample_s: float | None, samples: int) -> None:
    rules = rules_of({"max_seconds": 10.0})
    assert next_samples(0, rules, Known(2, sample_s=sample_s, left_s=left_s)) == samples
