"""What a frame in parts does next, and when it is over: by its samples, its error, its time."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from tests.service.dispatcher.parts.one_render import Seen, end_of_one, judge, noisy

from primray.distributed.planner import PartCosts
from primray.settings import SAMPLE_BLOCK
from primray_service.dispatcher.parts.plan import Judged, Plan, rules_of
from primray_service.jobs import Frame, Json, Part, PartState

FRAME = Frame("job_x", 0, None)


def begun(stop: Json, merged: int = 0, parts: tuple[Part, ...] = ()) -> Plan:
    plan = Plan(stop, 2)
    plan.begin(replace(FRAME, merged=merged), parts)
    return plan


def part(first: int, end: int, state: PartState) -> Part:
    return Part("job_x", 0, first, end, state)


def is_over(plan: Plan) -> bool:
    return plan.is_sampled(FRAME, runs=False, merges=False)


def test_by_samples_it_is_over_when_all_are_merged() -> None:
    plan = begun({"max_samples": 16})
    while (following := plan.next_part(FRAME)) is not None:
        plan.ledger.put(replace(following, state=PartState.DONE))
    assert not is_over(plan)
    plan.merged(16, None)
    assert is_over(plan)
    assert plan.end == (16, False)


def test_a_merge_is_awaited_where_all_samples_are_there() -> None:
    plan = begun({"max_samples": 16}, parts=(part(0, 8, PartState.DONE), part(8, 16, PartState.RUNNING)))
    assert not plan.is_merge_awaited(FRAME, runs=True)
    plan.ledger.put(part(8, 16, PartState.DONE))
    assert plan.is_merge_awaited(FRAME, runs=False)
    plan.merged(16, None)
    assert not plan.is_merge_awaited(FRAME, runs=False)


def test_a_merge_is_awaited_where_an_error_decides() -> None:
    """At the goal, whatever runs beyond it; and of what another dispatcher has merged."""
    plan = begun({"target_error": 0.1}, parts=(part(0, 4, PartState.DONE), part(4, 8, PartState.RUNNING)))
    assert plan.goal == 8
    assert not plan.is_merge_awaited(FRAME, runs=True)
    plan.ledger.put(part(4, 8, PartState.DONE))
    plan.ledger.put(part(8, 16, PartState.RUNNING))
    assert plan.is_merge_awaited(FRAME, runs=True)
    assert begun({"target_error": 0.1}, merged=16).is_merge_awaited(FRAME, runs=False)


def test_a_merge_is_awaited_when_time_is_over() -> None:
    plan = begun({"max_seconds": 10.0}, parts=(part(0, 8, PartState.DONE), part(8, 16, PartState.RUNNING)))
    plan.at(11.0, 1e6)
    assert not plan.is_merge_awaited(FRAME, runs=True)
    assert plan.is_merge_awaited(FRAME, runs=False)


def test_a_place_that_would_be_idle_merges() -> None:
    """All is given out, and more than one part has come."""
    plan = begun({"max_samples": 24}, parts=(part(0, 8, PartState.DONE), part(8, 16, PartState.DONE)))
    assert not plan.is_merge_awaited(FRAME, runs=True)
    plan.ledger.put(part(16, 24, PartState.RUNNING))
    assert plan.is_merge_awaited(FRAME, runs=True)


def test_an_odd_sample_is_the_pictures() -> None:
    plan = begun({"max_samples": 17}, merged=16)
    assert is_over(plan)
    assert plan.end == (17, False)


def test_what_came_back_goes_before_what_is_new() -> None:
    plan = begun({"max_samples": 64}, parts=(part(0, 8, PartState.RUNNING), part(8, 16, PartState.WAITING)))
    assert plan.next_part(FRAME) == part(8, 16, PartState.WAITING)


def test_by_an_error_it_is_over_when_that_is_met_whatever_runs() -> None:
    plan = begun({"target_error": 0.1}, parts=(part(0, 8, PartState.DONE), part(8, 16, PartState.RUNNING)))
    assert not plan.is_sampled(FRAME, runs=True, merges=True)
    assert [gone.first for gone in plan.merged(8, Judged(True, 8, 8))] == [0]
    assert plan.is_sampled(FRAME, runs=True, merges=False)
    assert plan.next_part(FRAME) is None
    assert plan.end == (8, False)


def test_by_time_it_is_over_with_what_is_merged() -> None:
    plan = begun({"max_seconds": 10.0}, parts=(part(0, 8, PartState.DONE), part(8, 16, PartState.WAITING)))
    plan.at(10.0, 86_400.0)
    assert plan.is_out_of_time
    assert not is_over(plan)  # there is one to merge
    plan.merged(8, None)
    assert is_over(plan)
    assert plan.end == (8, True)


def test_a_frame_without_a_sample_is_not_over_by_time() -> None:
    plan = begun({"max_seconds": 10.0}, parts=(part(0, 8, PartState.WAITING),))
    plan.at(11.0, 86_400.0)
    assert not plan.is_out_of_time
    assert not is_over(plan)
    assert plan.next_part(FRAME) == part(0, 8, PartState.WAITING)


def test_what_is_allowed_in_any_case_ends_it_too() -> None:
    plan = begun({"max_samples": 64}, merged=8)
    plan.at(5.0, 10.0)
    assert plan.time_left_s is None
    plan.at(10.0, 10.0)
    assert is_over(plan)
    assert plan.end == (8, True)


def test_what_was_merged_before_is_judged_first() -> None:
    """A server died before it could say what the error decides: nobody guesses."""
    plan = begun({"target_error": 0.1, "max_seconds": 10.0}, merged=16, parts=(part(16, 24, PartState.DONE),))
    plan.at(1.0, 86_400.0)
    assert (plan.goal, plan.next_part(FRAME), plan.to_merge()) == (None, None, [])
    assert not is_over(plan)
    plan.merged(16, Judged(False, 24, 24))
    assert [found.first for found in plan.to_merge()] == [16]


@pytest.mark.parametrize("most", [4, 5, 4096])
def test_parts_take_whole_blocks_of_samples(most: int) -> None:
    assert rules_of({"max_samples": most}).most == most // SAMPLE_BLOCK * SAMPLE_BLOCK


def test_places_render_ahead_of_a_measurement_but_not_far() -> None:
    plan = begun({"target_error": 0.1})
    given = []
    while (following := plan.next_part(FRAME)) is not None:
        given.append((following.first, following.end))
        plan.ledger.put(replace(following, state=PartState.DONE))
    assert given == [(0, 4), (4, 8), (8, 12), (12, 16)]
    assert [found.end for found in plan.to_merge()] == [4, 8]
    assert [gone.first for gone in plan.merged(8, Judged(False, 10, 10))] == [0, 4, 8]
    assert plan.next_part(FRAME) == part(8, 10, PartState.WAITING)


class Farm:
    """Parts under way, that come in any order: some are lost, some come long after all others."""

    def __init__(self, stop: Json, places: int, seed: int) -> None:
        self.rng = random.Random(seed)
        self.target, self.most = stop["target_error"], stop["max_samples"]
        self.stop = stop
        self.places = places
        self.error_at = noisy(seed % 7)
        self.merged = 0
        self.seen: tuple[Seen, ...] = ()
        self.under_way: list[Part] = []
        self.taken = 0
        self.plan = Plan(stop, places)
        self.plan.begin(FRAME, ())

    def run(self) -> tuple[int, bool]:
        """How the frame ended."""
        while not self.plan.is_sampled(FRAME, runs=bool(self.under_way), merges=False):
            self._give_out()
            if self.under_way and self.rng.random() < 0.8:
                self._ends(self.under_way.pop(self.rng.randrange(min(len(self.under_way), 3))))
            if self.rng.random() < 0.5:
                self._merge()
            if self.rng.random() < 0.05:
                self._dies()
        return self.plan.end

    def _give_out(self) -> None:
        while len(self.under_way) < self.places and (part := self.plan.next_part(FRAME)) is not None:
            assert all(part.end <= other.first or part.first >= other.end for other in self._of_use())
            self.plan.ledger.put(replace(part, state=PartState.RUNNING))
            self.under_way.append(part)

    def _of_use(self) -> list[Part]:
        return [part for part in self.under_way if not self.plan.ledger.is_cut(part)]

    def _ends(self, part: Part) -> None:
        self.plan.costs = PartCosts(self.rng.choice((None, 1e-3, 0.2, 10.0)))
        is_lost = self.rng.random() < 0.2
        self.taken += part.samples
        self.plan.ledger.ends(replace(part, state=PartState.WAITING if is_lost else PartState.DONE))

    def _merge(self) -> None:
        parts = self.plan.to_merge()
        if parts or self.plan.goal is None:
            for part in parts:
                assert part.first == self.merged
                self.merged = part.end
            found = judge(self.merged, self.seen, self.error_at, self.target, self.most)
            self.seen = found.seen
            self.plan.merged(self.merged, Judged(found.over == "target-error", found.goal, found.expected))

    def _dies(self) -> None:
        """The server; another one finds what is merged, and rows of parts, of which nobody takes any now."""
        left = [part for part in self.plan.ledger.parts if self.rng.random() < 0.9]
        self.plan = Plan(self.stop, self.places)
        self.plan.begin(
            replace(FRAME, merged=self.merged),
            [part if part.state is PartState.DONE else replace(part, state=PartState.WAITING) for part in left],
        )
        self.under_way = []


@pytest.mark.parametrize("seed", range(200))
def test_by_an_error_it_ends_where_one_render_does(seed: int) -> None:
    """However many places there are, in whatever order parts come, whatever is lost, however often the server dies."""
    stop: Json = {"target_error": (0.05, 0.013, 0.004)[seed % 3], "max_samples": (None, None, 97)[seed // 3 % 3]}
    farm = Farm(stop, 1 + seed % 5, seed)
    assert farm.run()[0] == end_of_one(farm.error_at, farm.target, farm.most)
