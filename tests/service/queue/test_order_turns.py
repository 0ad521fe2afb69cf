"""Whose frames are claimed next: several at once are those that one after another would be."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from primray_service.queue.order import Head, Line, Plan, Tenant


def line(name: str, *frames: int, first: float = 0.0, **tenant: int) -> Line:
    """Jobs name0, name1, ... of so many frames, each a second younger than the one before."""
    heads = [Head(f"{name}{i}", first + i, number) for i, number in enumerate(frames)]
    return Line(Tenant(name, **tenant), heads)


def one_by_one(lines: list[Line], most: int, turn: int = 0) -> list[str]:
    order = []
    for number in range(most):
        plan = Plan(1, turn + number)
        plan.fill(lines)
        order += list(plan.frames)
    return order


@pytest.mark.parametrize(
    ("running", "served", "order"),
    [
        ({}, {}, "aba"),  # never served: the oldest job's
        ({}, {"a": 3}, "bab"),
        ({}, {"a": 3, "b": 1}, "bab"),
        ({"b": 1}, {"a": 2, "b": 1}, "aba"),  # b has a frame that runs, a has none
        ({"a": 2}, {}, "bba"),
    ],
)
def test_whose_turn_it_is(running: Mapping[str, int], served: Mapping[str, int], order: str) -> None:
    lines = [line(name, 9, first=at, frames=running.get(name, 0), served=served.get(name, 0)) for at, name in enumerate("ab")]
    assert one_by_one(lines, 3, turn=3) == [f"{name}0" for name in order]


def test_several_at_once_are_those_of_one_after_another() -> None:
    def lines() -> list[Line]:
        return [line("a", 2, 1, 5), line("b", 1, 1, 1, 4, first=0.5, served=2), line("c", 3, frames=2), line("d", 1, served=1)]

    for most in range(20):
        plan = Plan(most, 5)
        plan.fill(lines())
        alone = one_by_one(lines(), most, 5)
        assert list(plan.frames.elements()) == sorted(alone, key=list(plan.frames).index)
        assert plan.frames.total() == min(most, 19)


def test_the_first_priority_goes_before_the_next() -> None:
    plan = Plan(3, 0)
    plan.fill([line("a", 2)])
    assert not plan.is_full
    plan.fill([line("b", 5), line("c", 5)])
    assert plan.frames == {"a0": 2, "b0": 1}


def test_a_tenant_begins_no_more_jobs_than_it_may() -> None:
    plan = Plan(9, 0)
    plan.fill([line("a", 2, 2, 2, most_jobs=2)])
    assert plan.frames == {"a0": 2, "a1": 2}


def test_who_may_begin_none_goes_on_with_those_begun() -> None:
    young, old = Head("young", 5.0, 2, begun=True), Head("old", 4.0, 1, begun=True)
    limited = Line(Tenant("a", jobs=2, most_jobs=2), [Head("new", 1.0, 3)], [young, old])
    assert one_by_one([limited], 4) == ["old", "young", "young"]


def test_what_was_begun_is_one_job_wherever_it_is_listed() -> None:
    limited = Line(Tenant("a", jobs=1, most_jobs=2), [Head("old", 1.0, 2, begun=True)], [Head("old", 1.0, 2, begun=True)])
    limited.more = lambda last: [Head("new", 2.0, 1), Head("newest", 3.0, 1)] if last.job_id == "old" else []
    assert one_by_one([limited], 5) == ["old", "old", "new"]


def test_jobs_are_read_when_those_before_them_are_planned() -> None:
    asked = []

    def more(last: Head) -> list[Head]:
        asked.append(last.job_id)
        return [Head("a1", 1.0, 1)] if last.job_id == "a0" else []

    lines = [line("a", 1), line("b", 1)]
    lines[0].more = more
    plan = Plan(2, 0)
    plan.fill(lines)
    assert (plan.frames, asked) == ({"a0": 1, "b0": 1}, [])
    plan = Plan(5, 2)
    plan.fill(lines)
    assert (plan.frames, asked) == ({"a1": 1}, ["a0", "a1"])


def test_after_a_job_in_parts_it_is_decided_anew() -> None:
    lines = [Line(Tenant("a"), [Head("parts", 0.0, 3, alone=True)]), line("b", 3, frames=0, served=1)]
    plan = Plan(5, 1)
    plan.fill(lines)
    assert plan.is_full
    assert plan.frames == {"parts": 1}
