"""Pausing and resuming jobs, retrying a frame: what the rows say, over both databases."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from primray_service.jobs import Frame, FrameState, Job, JobState
from primray_service.limits import Quotas
from primray_service.store.base import Conflict, QuotaExceeded

from ..world import ANY, World, any_quotas, new_job, new_scene, scene_id


def frame_of(world: World, job: Job, number: int = 0) -> Frame:
    found = world.store.frame(job.id, number)
    assert found is not None
    return found


def checkpointed(world: World, frame: Frame) -> None:
    given: Any = {"attempt": frame.attempt, "follows": 0, "file": "frames/0/checkpoint-1.prc", "now": world.tick()}
    assert world.store.accept_checkpoint(world.fence, "c1", frame.job_id, frame.number, **given)


def test_a_queued_job_is_paused_at_once_and_nothing_of_it_is_claimed(world: World):
    job = world.job()
    paused = world.store.request_pause(job.id, world.tick())
    assert paused.state == JobState.PAUSED
    assert paused.expires_at == world.now + job.ttl_s
    assert world.claims_nothing()
    assert world.store.request_pause(job.id, world.tick()) == paused
    resumed = world.store.request_resume(job.id, world.tick())
    assert (resumed.state, resumed.queued_at) == (JobState.QUEUED, world.now)
    assert world.claim().job.id == job.id


def test_a_running_job_pauses_with_its_last_frame_and_keeps_its_checkpoint(world: World):
    job = world.job(frames=3)
    first, second = world.claim().frame, world.claim().frame
    world.begin(first)
    checkpointed(world, first)
    assert world.store.request_pause(job.id, world.tick()).state == JobState.PAUSING
    assert world.claims_nothing()  # the third frame waits
    assert world.store.requeue_frame(world.fence, first, world.tick()).state == JobState.PAUSING
    assert world.end(second).state == JobState.PAUSED
    kept = frame_of(world, job)
    assert (kept.state, kept.checkpoint, kept.checkpoint_file) == (FrameState.QUEUED, 1, "frames/0/checkpoint-1.prc")
    world.store.request_resume(job.id, world.tick())
    again = world.claim().frame
    assert (again.number, again.checkpoint) == (0, 1)


def test_a_job_whose_last_frame_ends_while_it_pauses_has_ended(world: World):
    job = world.job()
    frame = world.claim().frame
    world.store.request_pause(job.id, world.tick())
    assert world.end(frame).state == JobState.SUCCEEDED


def test_resuming_while_frames_still_stop_runs_them_again(world: World):
    job = world.job()
    frame = world.claim().frame
    world.begin(frame)
    world.store.request_pause(job.id, world.tick())
    assert world.store.request_resume(job.id, world.tick()).state == JobState.RUNNING
    assert world.store.requeue_frame(world.fence, frame, world.tick()).state == JobState.QUEUED
    assert world.claim().frame.number == frame.number


@pytest.mark.parametrize("runs", [False, True])
def test_a_paused_job_can_be_canceled(world: World, runs: bool):
    job = world.job()
    frame = world.claim().frame if runs else None
    world.store.request_pause(job.id, world.tick())
    canceled = world.store.request_cancel(job.id, world.tick())
    assert canceled.state == (JobState.CANCELING if runs else JobState.CANCELED)
    if frame is not None:
        assert world.store.requeue_frame(world.fence, frame, world.tick()).state == JobState.CANCELED
    with pytest.raises(Conflict):
        world.store.request_pause(job.id, world.tick())
    with pytest.raises(Conflict):
        world.store.request_resume(job.id, world.tick())


def test_another_dispatcher_finds_a_paused_job_paused(world: World):
    runs, waits = world.job(frames=2), world.job()
    world.claim()
    world.store.request_pause(runs.id, world.tick())
    world.store.request_pause(waits.id, world.tick())
    world.tick(1e7)
    world.lead("d2")
    assert (world.get(runs).state, world.get(waits).state) == (JobState.PAUSED, JobState.PAUSED)
    assert frame_of(world, runs).state == FrameState.QUEUED
    assert world.claims_nothing()


def test_a_paused_job_expires_its_time_to_live_after_it_was_paused(world: World):
    job = world.job(ttl_s=100.0)
    world.tick(90)
    world.store.request_pause(job.id, world.tick())
    assert world.store.expire(world.fence, world.tick(90), 10) == ([], [])
    expired, _ = world.store.expire(world.fence, world.tick(20), 10)
    assert [each.id for each in expired] == [job.id]


@pytest.mark.parametrize("ok", [True, False])
def test_a_job_paused_before_its_scene_was_checked_hears_of_the_check(world: World, ok: bool):
    world.store.put_scene(new_scene("t", "c", world.tick()), ANY)
    job, _ = world.store.create_job(new_job("t", world.tick(), "c"), [None], ANY)
    world.store.request_pause(job.id, world.tick())
    problem = None if ok else {"type": "/problems/not-usd"}
    world.store.scene_checked(world.fence, scene_id("c"), world.tick(), facts={}, warnings=[], problem=problem)
    if ok:
        world.store.request_resume(job.id, world.tick())
        assert world.claim().job.id == job.id
    else:
        assert world.get(job).state == JobState.FAILED


def test_paused_jobs_count_among_those_that_wait(world: World):
    job = world.job()
    world.store.request_pause(job.id, world.tick())
    assert world.store.usage("t", world.now).queued_jobs == 1
    with pytest.raises(QuotaExceeded, match="queued_jobs"):
        world.store.create_job(new_job("t", world.tick()), [None], Quotas(queued_jobs=1))


def test_a_failed_frame_of_an_ended_job_is_retried_alone(world: World):
    job = world.job(frames=2)
    first, second = world.claim().frame, world.claim().frame
    checkpointed(world, first)
    world.end(replace(first, error={"type": "/problems/render-failed"}, cpu_s=5.0), FrameState.FAILED)
    ended = world.end(second)
    assert (ended.state, ended.error) == (JobState.FAILED, {"type": "/problems/render-failed"})
    again = world.store.retry_frame(job.id, 0, 1, world.tick(), ANY)
    assert (again.state, again.attempt, again.finished_at, again.error) == (JobState.QUEUED, 1, None, None)
    assert again.progress["frames"] == {"total": 2, "queued": 1, "running": 0, "succeeded": 1, "failed": 0, "canceled": 0}
    claimed = world.claim().frame
    assert (claimed.number, claimed.attempt, claimed.checkpoint_file, claimed.error) == (0, 2, "", None)
    assert claimed.cpu_s == 5.0
    assert frame_of(world, job, 1).state == FrameState.SUCCEEDED
    assert world.end(replace(claimed, cpu_s=7.0)).state == JobState.SUCCEEDED
    assert world.store.usage("t", world.now).cpu_s_total == 7.0
    assert [row.frame for row in world.store.outputs(job.id)] == [0, 1]


def test_a_frame_is_retried_while_the_others_run(world: World):
    job = world.job(frames=2)
    first = world.claim().frame
    world.claim()
    world.end(first)
    retried = world.store.retry_frame(job.id, 0, 1, world.tick(), ANY)
    assert retried.state == JobState.PREPARING
    assert world.claim().frame.number == 0
    late = world.end(replace(first, state=FrameState.FAILED), FrameState.FAILED)  # what an earlier run still says is dropped
    assert late.progress.get("frames") is None
    assert frame_of(world, job).state == FrameState.RUNNING


def test_what_cannot_be_retried(world: World):
    job = world.job(frames=2)
    with pytest.raises(Conflict):
        world.store.retry_frame(job.id, 1, 1, world.tick(), ANY)
    first = world.claim().frame
    with pytest.raises(Conflict):
        world.store.retry_frame(job.id, 0, 1, world.tick(), ANY)
    world.end(first)
    with pytest.raises(Conflict):  # who asks twice gets one
        world.store.retry_frame(job.id, 0, 2, world.tick(), ANY)
    with pytest.raises(KeyError):
        world.store.retry_frame(job.id, 7, 1, world.tick(), ANY)
    with pytest.raises(KeyError):
        world.store.retry_frame("job_none", 0, 1, world.tick(), ANY)


def test_a_retried_frame_of_a_paused_job_waits(world: World):
    job = world.job(frames=2)
    world.end(world.claim().frame)
    world.store.request_pause(job.id, world.tick())
    assert world.store.retry_frame(job.id, 0, 1, world.tick(), ANY).state == JobState.PAUSED
    assert world.claims_nothing()


def test_a_job_that_is_continued_after_a_retry_drops_what_the_retry_still_says(world: World):
    job = world.job()
    world.end(world.claim().frame)
    world.store.retry_frame(job.id, 0, 1, world.tick(), ANY)
    stale = world.claim().frame
    world.store.expire(world.fence, world.tick(2000.0), 10)
    world.store.continue_job(job.id, {"max_samples": 9}, world.tick(), ANY)
    now = world.claim().frame
    assert now.attempt == 3
    world.end(replace(stale, state=FrameState.FAILED), FrameState.FAILED)
    assert frame_of(world, job).state == FrameState.RUNNING


def test_jobs_of_all_tenants_are_listed_by_pages(world: World):
    jobs = [world.job(tenant) for tenant in ("a", "b", "a", "c", "b")]
    world.store.request_pause(jobs[1].id, world.tick())
    from primray_service.store.base import JobFilter

    seen, cursor = [], None
    while True:
        page = world.store.jobs(None, JobFilter(), 2, cursor)
        seen += [job.id for job in page.items]
        if (cursor := page.next_cursor) is None:
            break
    assert seen == [job.id for job in reversed(jobs)]
    paused = world.store.jobs(None, JobFilter(frozenset({JobState.PAUSED, JobState.RUNNING})), 10, None)
    assert [job.id for job in paused.items] == [jobs[1].id]
    with pytest.raises(ValueError, match="labels"):
        world.store.jobs(None, JobFilter(labels={"shot": "1"}), 10, None)


def test_running_frames_of_all_tenants(world: World):
    world.job("a", frames=2)
    world.job("b")
    claims = [world.claim() for _ in range(3)]
    assert {(job.tenant, frame.number) for job, frame in world.store.running_frames(10)} == {("a", 0), ("a", 1), ("b", 0)}
    world.end(claims[0].frame)
    assert len(world.store.running_frames(10)) == 2
    assert len(world.store.running_frames(1)) == 1


def test_quotas_that_were_set_and_usage_of_all_tenants(world: World):
    world.finished("a")
    world.store.set_quotas("b", {"running_jobs": 2, "cpu_s_per_day": None}, world.tick())
    assert world.store.quotas_set("b") == {"running_jobs": 2, "cpu_s_per_day": None}
    assert world.store.quotas_set("a") == {}
    found = dict(world.store.usage_of_all(world.now, 10))
    assert (found["a"].stored_bytes, found["b"].stored_bytes) == (110, 0)
    assert found["a"] == world.store.usage("a", world.now)
    assert [name for name, _ in world.store.usage_of_all(world.now, 10, after="a")] == ["b"]
    world.store.set_quotas("b", {}, world.tick())
    assert world.store.quotas_set("b") == {}


def test_claims_heed_quotas_of_paused_jobs_as_of_none(world: World):
    """A paused job gives its place among the running ones to another of its tenant."""
    first, second = world.job(frames=2), world.job()
    one = lambda tenant: Quotas(running_jobs=1)  # noqa: E731
    frame = world.claim_within(one).frame
    world.store.request_pause(first.id, world.tick())
    assert world.store.claim_frame(world.fence, world.tick(), one) is None  # it still stops
    world.store.requeue_frame(world.fence, frame, world.tick())
    assert world.claim_within(one).job.id == second.id
    assert world.store.claim_frame(world.fence, world.tick(), any_quotas) is None
