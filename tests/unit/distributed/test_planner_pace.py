"""Parts get shorter towards the end, are worth their cost, and never so long that losing one would be much."""

from __future__ import annotations

from primray.distributed.planner import LONGEST_S, MOST, PartCosts


def lengths(pace: PartCosts, samples: int, slots: int) -> list[int]:
    found = []
    while samples > 0:
        found.append(min(pace.samples(samples, slots), samples))
        samples -= found[-1]
    return found


def test_parts_get_shorter_towards_the_end() -> None:
    found = lengths(PartCosts(sample_s=1.0, beside_s=4.0), 1000, 4)
    assert found == sorted(found, reverse=True)
    assert (found[0], found[-1]) == (124, 2)


def test_no_part_is_longer_than_is_well_to_lose() -> None:
    assert PartCosts(sample_s=10.0).samples(10_000, 2) == LONGEST_S / 10.0
    assert PartCosts().samples(10_000, 2) == MOST


def test_all_slots_work_where_little_is_left() -> None:
    assert PartCosts(sample_s=1.0, beside_s=100.0).samples(8, 4) == 2
    assert PartCosts().samples(8, 2) == 4


def test_a_part_is_not_shorter_than_its_cost() -> None:
    assert PartCosts(sample_s=0.5, beside_s=10.0).samples(60, 2) == 20


def test_a_time_limit_shortens_parts() -> None:
    assert PartCosts(sample_s=1.0, beside_s=2.0).samples(10_000, 2, time_left_s=22.0) == 10
    assert PartCosts(sample_s=1.0, beside_s=2.0).samples(10_000, 2, time_left_s=0.0) == 2


def test_it_learns() -> None:
    assert PartCosts().seen(10, 5.0, 7.0) == PartCosts(0.5, 2.0)
    assert PartCosts(0.5, 2.0).seen(10, 15.0, 15.0) == PartCosts(1.0, 1.0)
