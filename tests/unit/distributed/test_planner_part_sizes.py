"""Parts become shorter towards the end of a frame, are worth their overhead, and losing one never costs much."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from primray.distributed.planner import FEWEST, LEAST_S, LONGEST_S, UNMEASURED, PartCosts, samples_of_next_part
from primray.settings import MAX_SPP, SAMPLE_BLOCK

ANY_COSTS = st.builds(PartCosts, st.one_of(st.none(), st.floats(1e-4, 1e3)), st.floats(0, 100))
BLOCKS = st.integers(2, 2048).map(lambda blocks: blocks * SAMPLE_BLOCK)
SLOTS = st.integers(1, 64)


def sizes_of(samples: int, slots: int, costs: PartCosts) -> list[int]:
    found: list[int] = []
    while size := samples_of_next_part(samples - sum(found), slots, costs):
        found.append(size)
    return found


def worth(costs: PartCosts) -> float:
    """The samples from which a part is worth its overhead."""
    return 0.0 if costs.sample_s is None else max(LEAST_S, costs.overhead_s) / costs.sample_s


@given(BLOCKS, SLOTS, ANY_COSTS)
def test_parts_hold_all_samples_and_become_shorter(samples: int, slots: int, costs: PartCosts) -> None:
    sizes = sizes_of(samples, slots, costs)
    assert sum(sizes) == samples
    assert all(size % SAMPLE_BLOCK == 0 for size in sizes)
    least = max(FEWEST, worth(costs) / 2)
    assert all(later <= earlier + least for earlier, later in itertools.pairwise(sizes))
    assert min(sizes) >= min(least, samples)


@given(BLOCKS, SLOTS, ANY_COSTS)
def test_no_part_is_longer_than_may_be_lost(samples: int, slots: int, costs: PartCosts) -> None:
    size = samples_of_next_part(samples, slots, costs)
    most = UNMEASURED[1] if costs.sample_s is None else LONGEST_S / costs.sample_s
    assert size < max(most, FEWEST) + max(FEWEST, worth(costs) / 2) + SAMPLE_BLOCK


@given(BLOCKS, SLOTS, ANY_COSTS, st.floats(-10, 1e4))
def test_parts_end_in_time(samples: int, slots: int, costs: PartCosts, time_left_s: float) -> None:
    size = samples_of_next_part(samples, slots, costs, time_left_s)
    assert size <= samples
    if time_left_s <= 0:
        assert size == 0
    elif costs.sample_s is not None and size > max(FEWEST, SAMPLE_BLOCK) + FEWEST:
        assert costs.overhead_s + size * costs.sample_s <= time_left_s


@given(BLOCKS, SLOTS, ANY_COSTS)
def test_no_slot_is_idle_where_parts_are_worth_it(samples: int, slots: int, costs: PartCosts) -> None:
    size = samples_of_next_part(samples, slots, costs)
    if samples / slots >= max(worth(costs) / 2, FEWEST):
        assert size < samples / slots + max(FEWEST, worth(costs) / 2) + SAMPLE_BLOCK


def test_parts_of_a_frame() -> None:
    sizes = sizes_of(1000, 4, PartCosts(sample_s=1.0, overhead_s=4.0))
    assert (sizes[:3], sizes[-3:]) == ([126, 110, 96], [4, 4, 4])
    assert samples_of_next_part(10_000, 2, PartCosts(sample_s=10.0)) == LONGEST_S / 10.0
    assert samples_of_next_part(10_000, 2, PartCosts()) == UNMEASURED[1]


def test_all_slots_render_where_few_samples_are_left() -> None:
    assert samples_of_next_part(16, 4, PartCosts(sample_s=1.0, overhead_s=4.0)) == 4
    assert samples_of_next_part(8, 2, PartCosts()) == 4


def test_a_part_takes_as_long_as_its_overhead_or_at_the_end_half_of_that() -> None:
    assert samples_of_next_part(60, 2, PartCosts(sample_s=0.5, overhead_s=10.0)) == 20
    assert samples_of_next_part(20, 2, PartCosts(sample_s=0.5, overhead_s=10.0)) == 10
    assert samples_of_next_part(8, 4, PartCosts(sample_s=1.0, overhead_s=100.0)) == 8
    # 34 samples of 0.04 s are left to two slots: 0.68 s for each, and no part of a moment after that.
    assert sizes_of(34, 2, PartCosts(sample_s=0.04)) == [18, 16]


@pytest.mark.parametrize(
    ("time_left_s", "sample_s", "samples"),
    [(10.0, None, FEWEST), (10.0, 0.1, 50), (1.0, 0.1, 6), (0.1, 0.1, 0), (0.0, None, 0), (-1.0, 0.1, 0)],
)
def test_a_time_limit_shortens_parts(time_left_s: float, sample_s: float | None, samples: int) -> None:
    assert samples_of_next_part(MAX_SPP, 2, PartCosts(sample_s), time_left_s) == samples


def test_overhead_counts_towards_the_time_limit() -> None:
    assert samples_of_next_part(10_000, 2, PartCosts(sample_s=1.0, overhead_s=2.0), time_left_s=22.0) == 10
    assert samples_of_next_part(10_000, 2, PartCosts(sample_s=1.0, overhead_s=22.0), time_left_s=22.0) == 0


def test_costs_are_running_means() -> None:
    assert PartCosts().with_part(10, 5.0, 2.0) == PartCosts(0.5, 2.0)
    assert PartCosts(0.5, 2.0).with_part(10, 15.0, 0.0) == PartCosts(1.0, 1.0)
