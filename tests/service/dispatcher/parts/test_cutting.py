"""How a frame is cut: all samples once, the last parts short, none beyond what is asked for."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from primray.settings import SAMPLE_BLOCK
from primray_service.dispatcher.frames.parts.chunk_size import LEAST, LEAST_S, Known, next_samples, rules_of


def cut(most: int, known: Known) -> list[int]:
    sizes: list[int] = []
    while size := next_samples(most - sum(sizes), known):
        sizes.append(size)
    return sizes


@given(st.integers(4, 4096), st.integers(2, 64), st.one_of(st.none(), st.floats(1e-4, 1e3)), st.floats(0, 100))
def test_parts_are_all_samples_and_the_last_are_short(most: int, places: int, sample_s: float | None, load_s: float) -> None:
    rules = rules_of({"max_samples": most})
    sizes = cut(rules.most, Known(places, sample_s=sample_s, load_s=load_s))
    assert sum(sizes) == rules.most == most // SAMPLE_BLOCK * SAMPLE_BLOCK
    assert all(size % SAMPLE_BLOCK == 0 for size in sizes)
    shortest = max(LEAST_S, load_s) / sample_s / 2 if sample_s else 0.0
    assert all(later <= earlier + max(LEAST, shortest) for earlier, later in itertools.pairwise(sizes))
    assert min(sizes) >= min(shortest, rules.most)
    if most >= 16 * places and sample_s is None:
        assert sizes[-1] <= 2 * LEAST


def test_the_last_parts_are_worth_their_cost() -> None:
    """34 samples of 0.04 s are left to two places: 0.68 s for each, and none of a moment after that."""
    assert cut(34, Known(2, sample_s=0.04)) == [18, 16]


@pytest.mark.parametrize(
    ("left_s", "sample_s", "samples"),
    [(10.0, None, LEAST), (10.0, 0.1, 50), (1.0, 0.1, 6), (0.1, 0.1, 0), (0.0, None, 0), (-1.0, 0.1, 0)],
)
def test_a_time_limit_makes_parts_short(left_s: float, sample_s: float | None, samples: int) -> None:
    most = rules_of({"max_seconds": 10.0}).most
    assert next_samples(most, Known(2, sample_s=sample_s, left_s=left_s)) == samples
