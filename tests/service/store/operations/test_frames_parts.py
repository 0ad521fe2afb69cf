"""Parts of frames: who has one, what it left, and that merged samples are counted once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from primray_service.jobs import Frame, Part, PartState
from primray_service.store.base import Lost

from ..world import World


def claimed(world: World) -> Frame:
    world.job(parallel="auto")
    return world.claim().frame


def given_out(world: World, frame: Frame, first: int, claim: str = "c1", **values: object) -> Part:
    part = Part(frame.job_id, frame.number, first, first + 8, PartState.RUNNING, claim)
    part = replace(part, **values)  # type: ignore[arg-type]
    assert world.store.give_out_part(world.fence, frame, part)
    return part


def accept(world: World, frame: Frame, merged: int, follows: int = 0) -> bool:
    return world.store.accept_checkpoint(
        world.fence,
        f"m{follows}",
        frame.job_id,
        frame.number,
        attempt=frame.attempt,
        follows=follows,
        file=f"merged-{follows}",
        now=world.tick(),
        merged=merged,
    )


def test_a_job_is_stored_with_how_parallel_it_is(world: World):
    assert [world.get(world.job(parallel=parallel)).parallel for parallel in (None, 4, "auto")] == [None, 4, "auto"]


def test_a_part_is_one_chunks_until_it_is_given_out_again(world: World):
    frame = claimed(world)
    first = given_out(world, frame, 0)
    saved = replace(first, checkpoint=1, checkpoint_file="f", kills=1)
    assert world.store.accept_part(world.fence, frame, saved)
    assert world.store.parts(frame.job_id, 0) == [saved]
    second = given_out(world, frame, 0, "c2", checkpoint=1, checkpoint_file="f")
    assert not world.store.accept_part(world.fence, frame, replace(saved, state=PartState.DONE))
    done = replace(second, state=PartState.DONE)
    assert world.store.accept_part(world.fence, frame, done)
    assert world.store.accept_part(world.fence, frame, done)  # once more, after the answer was lost
    assert world.store.parts(frame.job_id, 0) == [done]


def test_what_is_merged_is_no_part_any_more(world: World):
    frame = claimed(world)
    for first in (0, 8, 16):
        given_out(world, frame, first)
    assert accept(world, frame, merged=16)
    found = world.store.frame(frame.job_id, 0)
    assert found is not None
    assert (found.merged, found.checkpoint, found.checkpoint_file) == (16, 1, "merged-0")
    assert [part.first for part in world.store.parts(frame.job_id, 0)] == [16]
    assert accept(world, frame, merged=16)  # once more
    assert not accept(world, frame, merged=24, follows=3)


def test_a_checkpoint_of_a_whole_render_makes_parts_useless(world: World):
    frame = claimed(world)
    given_out(world, frame, 0)
    assert accept(world, frame, merged=0)
    assert world.store.parts(frame.job_id, 0) == []


def test_parts_of_a_frame_that_does_not_run_are_dropped(world: World):
    frame = claimed(world)
    part = given_out(world, frame, 0)
    world.store.requeue_frame(world.fence, frame, world.tick())
    assert not world.store.accept_part(world.fence, frame, part)
    assert not world.store.give_out_part(world.fence, frame, replace(part, first=8, end=16))
    assert world.store.parts(frame.job_id, 0) == [part]  # for who goes on with the frame
    again = world.claim().frame
    world.store.drop_parts(world.fence, again)
    assert world.store.parts(frame.job_id, 0) == []
    world.end(again)


def test_who_lost_the_lease_gives_out_nothing(world: World):
    frame = claimed(world)
    part = given_out(world, frame, 0)
    for call in (world.store.give_out_part, world.store.accept_part):
        with pytest.raises(Lost):
            call(world.fence + 1, frame, part)
    with pytest.raises(Lost):
        world.store.drop_parts(world.fence + 1, frame)


def test_parts_go_with_their_job(world: World):
    frame = claimed(world)
    given_out(world, frame, 0)
    world.end(frame)
    assert world.store.delete_job(frame.job_id)
    assert world.store.parts(frame.job_id, 0) == []
