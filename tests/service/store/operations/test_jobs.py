"""Jobs as clients see and change them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from primray_service.jobs import FrameState, JobState, etag, version_in
from primray_service.limits import Quotas
from primray_service.store.base import Conflict, KeyReused, QuotaExceeded

from ..world import ANY, T0, World, new_job, new_scene, scene_id


def test_a_job_comes_back_as_it_was_made(world: World):
    world.ready_scene()
    webhook = {"url": "https://example.org/ä", "events": ["completed"], "secret": "whsec_x"}
    odd = "\0 nul, \ud800 alone, ünï, \U0001f600, 'quote'; --"
    job = new_job(
        entry="a/b.usda",
        priority=7,
        labels={"shot": "010", odd: odd},
        webhook=webhook,
        request_id="req",
        traceparent="00-1-2-01",
        settings={"camera": odd, "seed": 2**32 - 1, "stop": {"target_error": 1e-300}},
    )
    made, is_new = world.store.create_job(job, [None, 1.5, -0.0], ANY)
    assert is_new
    assert made == job == world.get(job)
    assert [(f.number, f.time_code, f.state) for f in world.store.frames(job.id)] == [
        (0, None, FrameState.QUEUED),
        (1, 1.5, FrameState.QUEUED),
        (2, 0.0, FrameState.QUEUED),
    ]
    assert [(e.type, e.data) for e in world.store.events(job.id, 0, 10)] == [("state", {"state": "queued", "attempt": 1})]
    assert world.store.jobs("t", _labels({odd: odd}), 10, None).items == [job]


def test_only_its_tenant_sees_a_job(world: World):
    job = world.job("t")
    assert world.store.job(job.id, "t") == job
    assert world.store.job(job.id, "u") is None


@pytest.mark.parametrize("bad", ["", "\0", "job_\ud800", "job_ü", "x" * 5000, "' OR 1=1 --"])
def test_what_is_no_id_finds_nothing(world: World, bad: str):
    assert world.store.job(bad, bad) is None
    assert world.store.scene(bad, bad) is None
    assert world.store.key_by_sha256(bad) is None
    assert not world.store.frames(bad)
    assert not world.store.events(bad, 0, 10)
    assert world.store.delete_job(bad) is False


def test_a_page_after_any_number(world: World):
    job = world.job(frames=3)
    for after in (2**31 - 1, 2**63, 10**30):
        assert not world.store.frames(job.id, after=after)
        assert not world.store.events(job.id, after, 10)
        assert world.store.frame(job.id, after) is None
    assert len(world.store.frames(job.id, after=-(10**30))) == 3
    assert len(world.store.events(job.id, -(10**30), 10)) == 1


def test_a_job_needs_a_scene_of_its_tenant(world: World):
    world.ready_scene("t")
    with pytest.raises(Conflict):
        world.store.create_job(new_job("u"), [None], ANY)
    with pytest.raises(Conflict):
        world.store.create_job(new_job("t", scene="b"), [None], ANY)


def test_a_job_of_a_rejected_scene_fails_at_once(world: World):
    world.store.put_scene(new_scene(), ANY)
    problem = {"type": "/problems/not-usd", "title": "The file is not USD", "status": 422, "detail": "It is not."}
    world.store.scene_checked(world.fence, scene_id(), world.tick(), facts={}, warnings=[], problem=problem)
    job, is_new = world.store.create_job(new_job(), [None], ANY)
    assert is_new
    assert (job.state, job.error) == (JobState.FAILED, {**problem, "attempt": 1})
    assert world.states(job) == ["queued", "failed"]


def test_the_same_idempotency_key_is_the_same_job(world: World):
    world.ready_scene()
    first = new_job()
    assert world.store.create_job(first, [None], ANY, ("k", "request 1")) == (first, True)
    assert world.store.create_job(new_job(), [None], ANY, ("k", "request 1")) == (first, False)
    assert world.store.create_job(first, [None], ANY, ("k", "request 1")) == (first, True)  # the call repeated
    with pytest.raises(KeyReused):
        world.store.create_job(new_job(), [None], ANY, ("k", "request 2"))
    assert world.store.create_job(new_job(), [None], ANY, ("l", "request 2"))[1]
    world.ready_scene("u")
    assert world.store.create_job(new_job("u"), [None], ANY, ("k", "request 2"))[1]
    assert world.store.counts()["queued"] == 3


def test_idempotency_keys_are_kept_for_a_day(world: World):
    world.ready_scene()
    first = new_job(ttl_s=1e6)
    world.store.create_job(first, [None], ANY, ("k", "r"))
    world.store.expire(world.fence, T0 + 24 * 3600, 10)
    assert world.store.create_job(new_job(), [None], ANY, ("k", "r"))[1] is False
    world.store.expire(world.fence, T0 + 26 * 3600, 10)
    assert world.store.create_job(new_job(), [None], ANY, ("k", "r"))[1] is True


def test_queued_jobs_are_within_the_quota(world: World):
    world.ready_scene()
    two = Quotas(queued_jobs=2)
    for _ in range(2):
        world.store.create_job(new_job(), [None], two)
    with pytest.raises(QuotaExceeded, match="queued_jobs"):
        world.store.create_job(new_job(), [None], two)
    world.ready_scene("u")
    world.store.create_job(new_job("u"), [None], two)
    world.claim()
    world.store.create_job(new_job(), [None], two)  # one of the two runs


def test_who_stored_too_much_makes_no_jobs(world: World):
    world.ready_scene()
    with pytest.raises(QuotaExceeded, match="stored_bytes"):
        world.store.create_job(new_job(), [None], Quotas(stored_bytes=10))
    world.store.create_job(new_job(), [None], Quotas(stored_bytes=11))


def test_a_change_expects_the_version(world: World):
    job = world.job(labels={"a": "1"})
    changed = world.store.update_job(job.id, world.tick(), version=job.version, changes={"priority": 60, "labels": {"b": "2"}})
    assert (changed.priority, changed.labels, changed.version) == (60, {"b": "2"}, job.version + 1)
    assert changed == world.get(job)
    with pytest.raises(Conflict):
        world.store.update_job(job.id, world.tick(), version=job.version, changes={"priority": 61})
    assert world.store.update_job(job.id, world.tick(), version=None, changes={"priority": 61}).priority == 61
    with pytest.raises(KeyError):
        world.store.update_job("job_none", world.tick(), version=None, changes={"priority": 61})
    with pytest.raises(ValueError, match="state"):
        world.store.update_job(job.id, world.tick(), version=None, changes={"state": "failed"})
    assert not world.store.jobs("t", _labels({"a": "1"}), 10, None).items
    assert world.store.jobs("t", _labels({"b": "2"}), 10, None).items


def test_progress_changes_the_tag_but_not_the_version(world: World):
    job = world.job()
    frame = world.claim().frame
    running = world.begin(frame)
    later = world.store.report(world.fence, frame, world.tick(), job_changes={"progress": {"fraction": 0.5}})
    assert etag(later) != etag(running)
    assert version_in(etag(later)) == running.version == later.version
    changed = world.store.update_job(job.id, world.tick(), version=running.version, changes={"priority": 60})
    assert version_in(etag(changed)) == changed.version > running.version
    assert changed.revision > later.revision > running.revision > job.revision


@pytest.mark.parametrize("tag", ["", '""', '"1"', 'W/"1.2"', '"1.2', '"x.y"', '"-1.2"', '"١.٢"', f'"{"9" * 40}.1"'])
def test_foreign_tags_have_no_version(tag: str):
    assert version_in(tag) is None


def test_the_time_to_live_counts_from_the_queue_and_from_the_end(world: World):
    job = world.job(ttl_s=100)
    changed = world.store.update_job(job.id, world.tick(), version=None, changes={"ttl_s": 50.0})
    assert changed.expires_at == job.queued_at + 50
    ended = world.end(world.claim().frame)
    assert ended.finished_at == world.now
    assert ended.expires_at == world.now + 50
    assert (
        world.store.update_job(job.id, world.tick(), version=None, changes={"ttl_s": 5.0}).expires_at == ended.finished_at + 5
    )


def test_a_queued_job_is_canceled_at_once(world: World):
    job = world.job(frames=3)
    canceled = world.store.request_cancel(job.id, world.tick())
    assert (canceled.state, canceled.finished_at) == (JobState.CANCELED, world.now)
    assert world.store.frame_counts(job.id)["canceled"] == 3
    assert world.store.request_cancel(job.id, world.tick()) == canceled
    assert world.claims_nothing()
    with pytest.raises(KeyError):
        world.store.request_cancel("job_none", world.tick())


def test_a_running_job_is_canceled_when_its_frames_have_stopped(world: World):
    job = world.job(frames=3)
    first, second = world.claim().frame, world.claim().frame
    world.begin(first)
    canceling = world.store.request_cancel(job.id, world.tick())
    assert canceling.state == JobState.CANCELING
    assert world.store.request_cancel(job.id, world.tick()) == canceling
    assert world.claims_nothing()
    assert world.begin(second).state == JobState.CANCELING  # said before the worker knew
    assert world.end(first).state == JobState.CANCELING
    canceled = world.store.requeue_frame(world.fence, second, world.tick())
    assert canceled.state == JobState.CANCELED
    assert world.store.frame_counts(job.id) == {"queued": 0, "running": 0, "succeeded": 1, "failed": 0, "canceled": 2}
    assert [output.name for output in world.store.outputs(job.id)] == ["frame.0.exr"]
    assert world.states(job) == ["queued", "preparing", "running", "canceling", "canceled"]


def test_what_has_ended_is_not_canceled(world: World):
    job = world.finished()
    with pytest.raises(Conflict):
        world.store.request_cancel(job.id, world.tick())
    assert world.get(job) == job


def test_a_job_is_continued_from_its_checkpoints(world: World):
    job = world.job(frames=2)
    frame = world.claim().frame
    assert world.store.accept_checkpoint(
        world.fence, "c", job.id, 0, attempt=1, follows=0, file="checkpoint-1.prc", now=world.tick()
    )
    world.end(replace(frame, checkpoint=1, cpu_s=3.0))
    failed = world.end(world.claim().frame, FrameState.FAILED, error={"type": "/problems/render-failed"})
    assert (failed.state, failed.error) == (JobState.FAILED, {"type": "/problems/render-failed"})

    again = world.store.continue_job(job.id, {"max_samples": 128}, world.tick(), ANY)
    assert (again.state, again.attempt, again.queued_at) == (JobState.QUEUED, 2, world.now)
    assert (again.settings["stop"], again.error, again.finished_at) == ({"max_samples": 128}, None, None)
    assert again.expires_at == world.now + job.ttl_s
    frames = world.store.frames(job.id)
    assert [(f.state, f.attempt, f.checkpoint, f.checkpoint_file) for f in frames] == [
        (FrameState.QUEUED, 2, 1, "checkpoint-1.prc"),
        (FrameState.QUEUED, 2, 0, ""),
    ]
    assert len(world.store.outputs(job.id)) == 1  # until they are replaced
    with pytest.raises(Conflict):
        world.store.continue_job(job.id, {"max_samples": 256}, world.tick(), ANY)
    assert world.end(world.claim().frame).state == JobState.PREPARING
    assert world.end(world.claim().frame).state == JobState.SUCCEEDED
    assert world.states(job) == ["queued", "preparing", "failed", "queued", "preparing", "succeeded"]


def test_results_of_an_earlier_attempt_are_dropped(world: World):
    job = world.job()
    old = world.claim().frame
    world.end(old)
    world.store.continue_job(job.id, {"max_samples": 128}, world.tick(), ANY)
    new = world.claim().frame
    assert world.end(old).state == JobState.PREPARING
    assert world.store.requeue_frame(world.fence, old, world.tick()).state == JobState.PREPARING
    assert world.begin(old).state == JobState.PREPARING
    assert not world.store.accept_checkpoint(world.fence, "c", job.id, 0, attempt=1, follows=0, file="x", now=world.tick())
    assert world.end(new).state == JobState.SUCCEEDED


def test_continuing_needs_room_and_the_scene(world: World):
    job = world.finished()
    world.job()
    with pytest.raises(QuotaExceeded):
        world.store.continue_job(job.id, {}, world.tick(), Quotas(queued_jobs=1))
    with pytest.raises(KeyError):
        world.store.continue_job("job_none", {}, world.tick(), ANY)
    other = world.finished(scene="b", priority=90)
    world.store.delete_scene("t", scene_id("b"))
    with pytest.raises(Conflict):
        world.store.continue_job(other.id, {}, world.tick(), ANY)


def test_deleting_takes_all_that_hangs_on_it(world: World):
    job = world.job(labels={"a": "1"}, webhook={"url": "https://x", "events": ["started"], "secret": "s"})
    frame = world.claim().frame
    world.begin(frame)
    with pytest.raises(Conflict):
        world.store.delete_job(job.id)
    world.end(frame)
    assert world.store.usage("t", world.now).stored_bytes == 110
    assert world.store.delete_job(job.id)
    assert not world.store.delete_job(job.id)
    assert world.store.job(job.id) is None
    for rest in (world.store.frames, world.store.outputs, world.store.webhooks):
        assert not rest(job.id)
    assert not world.store.events(job.id, 0, 10)
    assert world.store.usage("t", world.now).stored_bytes == 10


def test_what_is_not_finished_in_time_expires(world: World):
    waiting, running, done, canceling = (world.job(ttl_s=100.0, priority=p, frames=2) for p in (1, 9, 8, 7))
    frames = [world.claim().frame for _ in range(3)]
    assert [f.job_id for f in frames] == [running.id, running.id, done.id]
    world.end(frames[2])
    world.end(world.claim().frame)
    world.claim()
    world.store.request_cancel(canceling.id, world.tick())
    world.begin(frames[0])
    in_time, _ = world.store.expire(world.fence, T0 + 50, 10)
    assert not in_time
    world.now = T0 + 150
    expired, ended = world.store.expire(world.fence, world.now, 10)
    assert {job.id for job in expired} == {waiting.id, running.id}
    assert all(job.state == JobState.EXPIRED and job.error and job.error["type"] == "/problems/job-expired" for job in expired)
    assert ended == [done.id]
    assert world.get(canceling).state == JobState.CANCELING  # it ends as it was asked to
    assert world.end(frames[0]).state == JobState.EXPIRED  # too late
    assert not world.store.outputs(running.id)
    _, ended = world.store.expire(world.fence, world.now + 101, 10)
    assert {waiting.id, running.id, done.id} == set(ended)


def test_progress_events_are_kept_for_an_hour_all_others_as_long_as_the_job(world: World):
    job = world.job(ttl_s=1e6)
    frame = world.claim().frame
    for type_ in ("progress", "preview", "warning"):
        world.store.report(world.fence, frame, world.tick(), events=[(type_, {})])
    world.store.expire(world.fence, world.now + 3000, 10)
    assert [e.type for e in world.store.events(job.id, 0, 99)][-3:] == ["progress", "preview", "warning"]
    world.store.expire(world.fence, world.now + 4000, 10)
    assert [e.type for e in world.store.events(job.id, 0, 99)] == ["state", "state", "frame", "warning"]


def test_subscribers_hear_of_every_change_of_a_job(world: World):
    heard: list[str] = []
    end = world.store.subscribe(heard.append)

    def fails(job_id: str) -> None:
        raise RuntimeError(job_id)

    world.store.subscribe(fails)  # who fails harms nobody
    job = world.job()
    frame = world.claim().frame
    world.begin(frame)
    world.store.accept_checkpoint(world.fence, "c", job.id, 0, attempt=1, follows=0, file="f", now=world.tick())
    world.end(frame)
    assert heard == [job.id] * 5
    end()
    world.store.delete_job(job.id)
    assert len(heard) == 5


def _labels(labels: dict[str, str]):
    from primray_service.store.base import JobFilter

    return JobFilter(labels=labels)
