"""States of jobs: terminal ones only lead back to the queue, and a job's end follows from its frames."""

from __future__ import annotations

import pytest

from primray_service.jobs import MOVES, TERMINAL, FrameState, JobState, is_legal, state_of_all, version_in

F = FrameState


def test_every_state_has_its_moves_and_reaches_an_end() -> None:
    assert set(MOVES) == set(JobState)
    for state in set(JobState) - TERMINAL:
        reached, seen = {state}, {state}
        while reached:
            reached = {to for each in reached for to in MOVES[each]} - seen
            seen |= reached
        assert seen & TERMINAL, state


@pytest.mark.parametrize("state", sorted(TERMINAL))
def test_an_ended_job_can_only_be_queued_again(state: JobState) -> None:
    assert [to for to in JobState if is_legal(state, to)] == [JobState.QUEUED]


def test_a_job_that_is_canceling_ends_as_canceled() -> None:
    assert MOVES[JobState.CANCELING] == {JobState.CANCELED}


@pytest.mark.parametrize(
    ("frames", "state"),
    [
        ([F.SUCCEEDED, F.SUCCEEDED], JobState.SUCCEEDED),
        ([F.SUCCEEDED, F.FAILED], JobState.FAILED),
        ([F.FAILED, F.CANCELED, F.SUCCEEDED], JobState.CANCELED),
        ([F.SUCCEEDED, F.RUNNING], None),
        ([F.FAILED, F.QUEUED], None),
    ],
)
def test_the_end_of_a_job_follows_from_its_frames(frames: list[FrameState], state: JobState | None) -> None:
    assert state_of_all(frames) == state


def test_versions_in_entity_tags() -> None:
    assert version_in('"12.3"') == 12
    for tag in ("12.3", '"12"', '"a.3"', '"1.2.3"', 'W/"12.3"'):
        assert version_in(tag) is None
