"""Which samples of a frame are where."""

from __future__ import annotations

from dataclasses import replace

from primray_service.dispatcher.parts.plan import Ledger, waits_again
from primray_service.jobs import Part, PartState


def part(first: int, end: int, state: PartState = PartState.DONE) -> Part:
    return Part("job_x", 0, first, end, state)


def test_only_what_follows_without_a_gap_is_merged() -> None:
    ledger = Ledger(8, [part(8, 16), part(16, 24, PartState.RUNNING), part(24, 32)])
    assert [found.first for found in ledger.to_merge(64)] == [8]
    assert (ledger.given, ledger.taken()) == (32, 24)
    ledger.put(part(16, 24))
    assert [found.first for found in ledger.to_merge(64)] == [8, 16, 24]
    assert [found.first for found in ledger.to_merge(31)] == [8, 16]
    assert [found.first for found in ledger.merge(24)] == [8, 16]
    assert (ledger.merged, [found.first for found in ledger.parts]) == (24, [24])


def test_the_first_that_came_back_is_given_out_first() -> None:
    ledger = Ledger(0, [part(0, 8), part(8, 16, PartState.RUNNING), part(16, 24, PartState.RUNNING)])
    assert ledger.waiting() is None
    for first in (16, 8):
        ledger.put(waits_again(part(first, first + 8)))
    assert ledger.waiting() == replace(part(8, 16), state=PartState.WAITING)


def test_what_is_merged_or_overlaps_was_left_by_a_server_that_died_between_two_rows() -> None:
    ledger = Ledger(8, [part(0, 8), part(12, 24), part(16, 20), part(28, 32)])
    assert [(found.first, found.end) for found in ledger.parts] == [(12, 24), (28, 32)]
    assert [ledger.board.next_part(64, 64, 8)] == [(8, 12)]


def test_parts_across_a_goal_are_cut_and_taken_anew() -> None:
    """One that is being taken may not be given to another until it has ended, however that is."""
    for state in PartState:
        ledger = Ledger(8, [part(8, 16), replace(part(16, 32, state), checkpoint_file="p16"), part(32, 40)])
        [before] = ledger.cut(20)
        assert (before.end, before.checkpoint_file) == (32, "p16")
        assert ledger.is_cut(before)
        assert ledger.board.next_part(20, 64, 64) == (20, 32)
        if state is PartState.RUNNING:
            assert ledger.waiting() is None
            assert not ledger.ends(replace(before, state=PartState.DONE))
        assert ledger.waiting() == part(16, 20, PartState.WAITING)
        assert [found.first for found in ledger.to_merge(20)] == [8]
        assert ledger.cut(20) == []
