"""Frames, as the dispatcher tells of them: progress, checkpoints, ends; and what comes too late."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from primray_service.jobs import FrameState, IllegalMove, JobState, Output
from primray_service.store.base import Lost
from primray_service.store.operations.open_job import open_job

from ..world import World


def test_a_report_is_stored_with_its_event_and_what_it_changes_of_the_job(world: World):
    job = world.job()
    frame = replace(
        world.claim().frame,
        phase="sampling",
        progress={"fraction": 0.25},
        effective_settings={"spp": 4},
        convergence=[{"t_s": 1.0, "relmse": 0.5}],
        cpu_s=2.5,
        peak_rss_bytes=2**33,
    )
    warning = {"code": "unsupported-schema", "prim": "/W", "detail": "..", "severity": "warning"}
    changes = {
        "state": JobState.RUNNING,
        "progress": {"fraction": 0.25},
        "warnings": [warning],
        "effective_settings": {"spp": 4},
    }
    said: list[tuple[str, Any]] = [("warning", warning), ("progress", changes["progress"])]
    told = world.store.report(world.fence, frame, world.tick(), job_changes=changes, events=said)
    assert world.store.frame(job.id, 0) == frame
    assert told == world.get(job)
    assert (told.state, told.started_at, told.warnings) == (JobState.RUNNING, world.now, [warning])
    last = world.store.events(job.id, 0, 99)[-3:]
    assert [(e.type, e.data) for e in last] == [("state", {"state": "running", "attempt": 1}), *said]
    usage = world.store.usage("t", world.now)
    assert (usage.cpu_s_today, usage.cpu_s_total) == (2.5, 2.5)


def test_a_report_takes_nothing_that_only_an_end_may_say(world: World):
    world.job()
    frame = world.claim().frame
    refused: list[Any] = [{"state": JobState.SUCCEEDED}, {"result": {}}, {"error": {}}, {"priority": 3}, {"tenant": "u"}]
    for changes in refused:
        with pytest.raises(ValueError, match="cannot be reported"):
            world.store.report(world.fence, frame, world.tick(), job_changes=changes)


def test_no_illegal_move_is_stored(world: World):
    job = world.finished()

    def work(transaction):
        opened = open_job(transaction, job.id)
        assert opened is not None
        opened.move(JobState.RUNNING, world.now)

    with pytest.raises(IllegalMove, match="succeeded"):
        world.store._db.write(work)
    assert world.get(job) == job


def test_a_checkpoint_is_taken_over_once(world: World):
    job = world.job()
    frame = world.claim().frame
    world.store.requeue_frame(world.fence, replace(frame, crashes=1, kills=4), world.tick())
    frame = world.claim().frame
    assert (frame.crashes, frame.kills) == (1, 4)

    def accept(chunk: str, follows: int, file: str, attempt: int = 1) -> bool:
        given: Any = {"attempt": attempt, "follows": follows, "file": file, "now": world.tick()}
        return world.store.accept_checkpoint(world.fence, chunk, job.id, 0, **given)

    assert not accept("c1", 1, "checkpoint-2.prc")  # there is no first
    assert accept("c1", 0, "checkpoint-1.prc")
    assert accept("c1", 0, "checkpoint-1.prc")  # the call repeated
    assert not accept("c2", 0, "checkpoint-1.prc")  # the same work done twice
    assert not accept("c2", 0, "other.prc")
    assert accept("c1", 1, "checkpoint-2.prc")  # a chunk writes several
    assert not accept("c1", 0, "checkpoint-1.prc")
    assert not accept("c1", 2, "checkpoint-3.prc", attempt=2)
    stored = world.store.frame(job.id, 0)
    assert stored is not None
    assert (stored.checkpoint, stored.checkpoint_file, stored.crashes, stored.kills) == (2, "checkpoint-2.prc", 0, 0)
    world.end(frame)
    assert not accept("c1", 2, "checkpoint-3.prc")
    with pytest.raises(Lost):
        world.store.accept_checkpoint(world.fence + 1, "c", job.id, 0, attempt=1, follows=2, file="x", now=world.tick())


def test_a_job_ends_with_its_last_frame(world: World):
    job = world.job(frames=2)
    first, second = world.claim().frame, world.claim().frame
    world.begin(first)
    still = world.end(replace(second, result={"spp": 4}), result={"not": "yet"}, progress={"fraction": 0.5})
    assert (still.state, still.result, still.progress) == (JobState.RUNNING, None, {"fraction": 0.5})
    ended = world.end(first, result={"frames": 2}, usage={"cpu_s": 3.0}, progress={"fraction": 1.0})
    assert (ended.state, ended.result, ended.usage) == (JobState.SUCCEEDED, {"frames": 2}, {"cpu_s": 3.0})
    assert ended == world.get(job)
    stored = world.store.frame(job.id, 1)
    assert stored is not None
    assert (stored.state, stored.result, stored.finished_at) == (FrameState.SUCCEEDED, {"spp": 4}, world.now - 1)
    kinds = [(e.type, e.data.get("frame"), e.data["state"]) for e in world.store.events(job.id, 0, 99)][-4:]
    assert kinds == [
        ("frame", 1, "succeeded"),
        ("frame", 0, "succeeded"),
        ("state", None, "succeeded"),
        ("end", None, "succeeded"),
    ]


def test_a_job_fails_if_a_frame_did_with_the_first_frames_error(world: World):
    job = world.job(frames=3)
    first, second, third = (world.claim().frame for _ in range(3))
    world.end(replace(third, error={"detail": "third"}), FrameState.FAILED)
    world.end(replace(second, error={"detail": "second"}), FrameState.FAILED)
    failed = world.end(first)
    assert (failed.state, failed.error) == (JobState.FAILED, {"detail": "second"})
    end = world.store.events(job.id, 0, 99)[-1]
    assert (end.type, end.data) == ("end", {"state": "failed", "attempt": 1, "error": {"detail": "second"}})


def test_an_end_counts_once(world: World):
    job = world.job()
    frame = replace(world.claim().frame, cpu_s=5.0)
    ended = world.end(frame)
    assert world.end(replace(frame, cpu_s=9.0), FrameState.FAILED) == ended == world.get(job)
    assert world.store.requeue_frame(world.fence, frame, world.tick()) == ended
    assert world.begin(frame) == ended
    usage = world.store.usage("t", world.now)
    assert (usage.cpu_s_total, usage.stored_bytes) == (5.0, 110)


def test_outputs_take_the_place_of_the_frames_earlier_ones(world: World):
    job = world.job(frames=2)

    def out(name: str, frame: int | None, size: int) -> Output:
        return Output(job.id, name, frame, size, "cd" * 32, "image/png", world.now)

    def end(number: int, *outputs: Output) -> None:
        claim = world.claim()
        assert claim.frame.number == number
        ended = replace(claim.frame, state=FrameState.SUCCEEDED)
        world.store.end_frame(world.fence, ended, world.tick(), outputs=outputs, job_changes={})

    end(0, out("a.exr", 0, 1000), out("a.png", 0, 10))
    end(1, out("b.exr", 1, 1000), out("all.json", None, 7))
    assert world.store.usage("t", world.now).stored_bytes == 10 + 2017
    world.store.continue_job(job.id, {}, world.tick(), world_any())
    end(0, out("a.exr", 0, 500))
    end(1, out("b.exr", 1, 600), out("all.json", None, 8))
    assert [(o.name, o.bytes) for o in world.store.outputs(job.id)] in (
        [("a.exr", 500), ("b.exr", 600), ("all.json", 8)],
        [("all.json", 8), ("a.exr", 500), ("b.exr", 600)],
    )
    assert world.store.usage("t", world.now).stored_bytes == 10 + 1108


def world_any():
    from ..world import ANY

    return ANY


def test_a_frame_that_gives_way_waits_again(world: World):
    job = world.job(frames=2)
    first, second = world.claim().frame, world.claim().frame
    world.begin(first)
    back = replace(first, crashes=1, cpu_s=4.0, phase="sampling")
    assert world.store.requeue_frame(world.fence, back, world.tick()).state == JobState.RUNNING
    assert world.store.requeue_frame(world.fence, second, world.tick()).state == JobState.QUEUED
    again = world.claim().frame
    assert (again.number, again.crashes, again.cpu_s, again.started_at) == (0, 1, 4.0, first.started_at)
    assert world.begin(again).started_at is not None
    assert world.states(job) == ["queued", "preparing", "running", "queued", "preparing", "running"]


def test_cpu_seconds_are_counted_once_on_the_day_they_were_used(world: World):
    job = world.job(ttl_s=1e7)
    day = 24 * 3600.0
    frame = world.claim().frame
    for seconds in (2.0, 5.0, 5.0):
        world.store.report(world.fence, replace(frame, cpu_s=seconds), world.now)
    assert world.store.usage("t", world.now).cpu_s_today == 5.0
    world.tick(day)
    world.store.requeue_frame(world.fence, replace(frame, cpu_s=6.0), world.now)
    world.end(replace(world.claim().frame, cpu_s=8.5))
    usage = world.store.usage("t", world.now)
    assert (usage.cpu_s_today, usage.cpu_s_total) == (3.5, 8.5)
    assert world.store.usage("t", world.now - day).cpu_s_today == 5.0
    assert world.get(job).state == JobState.SUCCEEDED


def test_a_frame_of_a_job_that_is_gone(world: World):
    world.job()
    frame = replace(world.claim().frame, job_id="job_none")
    for call in (world.begin, world.end, lambda frame: world.store.requeue_frame(world.fence, frame, world.now)):
        with pytest.raises(KeyError):
            call(frame)
