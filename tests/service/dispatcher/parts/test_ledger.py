"""Which samples of a frame are where."""

from __future__ import annotations

from dataclasses import replace

from primray_service.dispatcher.frames.parts.ledger import Ledger, waits_again
from primray_service.jobs import Part, PartState


def part(first: int, end: int, state: PartState = PartState.DONE) -> Part:
    return Part("job_x", 0, first, end, state)


def test_only_what_follows_without_a_gap_is_merged() -> None:
    ledger = Ledger(8, [part(8, 16), part(16, 24, PartState.RUNNING), part(24, 32)])
    assert [found.first for found in ledger.to_merge()] == [8]
    assert (ledger.given, ledger.taken()) == (32, 24)
    ledger.put(part(16, 24))
    assert [found.first for found in ledger.to_merge()] == [8, 16, 24]
    assert [found.first for found in ledger.merge(24)] == [8, 16]
    assert (ledger.merged, [found.first for found in ledger.parts]) == (24, [24])


def test_the_first_that_came_back_is_given_out_first() -> None:
    ledger = Ledger(0, [part(0, 8), part(8, 16, PartState.RUNNING), part(16, 24, PartState.RUNNING)])
    assert ledger.waiting() is None
    for first in (16, 8):
        ledger.put(waits_again(part(first, first + 8)))
    assert ledger.waiting() == replace(part(8, 16), state=PartState.WAITING)


def test_what_is_beyond_a_gap_is_given_out_anew() -> None:
    """A server died between the rows of two parts."""
    ledger = Ledger(8, [part(0, 8), part(16, 24)])
    assert (ledger.given, ledger.parts) == (8, [])
