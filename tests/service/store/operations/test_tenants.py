"""Keys, usage, counts and webhooks."""

from __future__ import annotations

from dataclasses import replace

import pytest

from primray_service.jobs import FrameState, JobState
from primray_service.limits import Quotas
from primray_service.store import SqlStore
from primray_service.store.base import ApiKey, Lost

from ..world import T0, World

KEY = ApiKey(
    id="key_1",
    tenant="t",
    name="render ü farm",
    prefix="pr_abcd",
    sha256="0f" * 32,
    scopes=frozenset({"submit", "read"}),
    quotas=Quotas(requests_per_s=None, running_jobs=3),
    created_at=T0,
    expires_at=T0 + 5,
)


def test_keys(store: SqlStore):
    store.create_key(KEY)
    store.create_key(KEY)  # the call repeated
    other = replace(KEY, id="key_2", tenant="u", sha256="1f" * 32, created_at=T0 + 1)
    store.create_key(other)
    assert store.key_by_sha256(KEY.sha256) == KEY
    assert store.key_by_sha256("2f" * 32) is None
    assert store.keys() == [KEY, other]
    assert store.keys("u") == [other]
    assert store.revoke_key("key_1", T0 + 2)
    assert store.revoke_key("key_1", T0 + 2)  # the call repeated
    assert not store.revoke_key("key_1", T0 + 3)
    assert not store.revoke_key("key_3", T0 + 3)
    assert store.key_by_sha256(KEY.sha256) == replace(KEY, revoked_at=T0 + 2)


def test_cpu_seconds_outside_of_frames_count_towards_the_day(store: SqlStore):
    for seconds in (1.5, 2.0):
        store.spend_cpu("t", T0, seconds)
    store.spend_cpu("u", T0, 9.0)
    assert (store.usage("t", T0).cpu_s_today, store.usage("t", T0).cpu_s_total) == (3.5, 3.5)
    assert (store.usage("t", T0 + 86_400).cpu_s_today, store.usage("t", T0 + 86_400).cpu_s_total) == (0.0, 3.5)


def test_counts_and_usage(world: World):
    done, failed, waiting = world.job(frames=1), world.job(), world.job()
    canceling, running, other = world.job(priority=90), world.job(priority=80), world.job("u", priority=10)
    for job in (canceling, running, done, failed):
        claim = world.claim()
        assert claim.job.id == job.id
        if job is done:
            world.end(claim.frame)
        if job is failed:
            world.end(claim.frame, FrameState.FAILED)
    world.store.request_cancel(canceling.id, world.tick())
    expected = {state.value: 0 for state in JobState}
    expected |= {"queued": 2, "preparing": 1, "canceling": 1, "succeeded": 1, "failed": 1}
    assert world.store.counts() == expected
    usage = world.store.usage("t", world.now)
    assert (usage.queued_jobs, usage.running_jobs, usage.stored_bytes) == (1, 2, 110)
    assert world.store.usage("u", world.now).queued_jobs == 1
    assert world.store.usage("nobody", world.now).stored_bytes == 0
    assert {waiting.id, other.id} == {world.claim().job.id for _ in range(2)}


WEBHOOK = {"url": "https://example.org/hook", "events": ["started", "frame.completed", "completed"], "secret": "whsec_x"}


def test_webhooks_tell_what_they_are_asked_for_as_it_happens(world: World):
    job = world.job(frames=2, webhook=WEBHOOK, labels={"shot": "010"})
    quiet = world.job(webhook={**WEBHOOK, "events": []}, priority=1)
    silent = world.job(priority=1)
    first, second = world.claim().frame, world.claim().frame
    world.begin(first)
    world.begin(second)  # a second frame that begins is no second start
    world.end(first)
    failed = replace(second, error={"type": "/problems/render-failed"})
    world.store.end_frame(
        world.fence,
        replace(failed, state=FrameState.FAILED),
        world.tick(),
        outputs=[],
        job_changes={"error": {"detail": "all"}},
        webhook_events=["frame.completed", "completed"],  # said twice, sent once
    )
    sent = sorted(world.store.webhooks(job.id), key=lambda one: one.id)
    assert [one.event for one in sent] == ["started", "frame.completed", "frame.completed", "completed"]
    assert len({one.id for one in sent}) == 4
    assert all(one.id.startswith("msg_") and (one.url, one.secret) == (WEBHOOK["url"], "whsec_x") for one in sent)
    started, frame0, frame1, completed = (one.payload for one in sent)
    assert started["type"] == "job.started"
    assert started["timestamp"] == started["data"]["started_at"]
    assert started["data"]["state"] == "running"
    assert frame0["type"] == "job.frame.completed"
    assert frame0["data"]["frame"]["outputs"] == ["frame.0.exr"]
    assert frame1["data"]["frame"]["error"] == {"type": "/problems/render-failed"}
    assert completed["data"]["id"] == job.id
    assert completed["data"]["labels"] == {"shot": "010"}
    assert (completed["data"]["state"], completed["data"]["error"]) == ("failed", {"detail": "all"})
    assert "whsec" not in str([one.payload for one in sent])
    for other in (quiet, silent):
        world.end(world.claim().frame)
        assert not world.store.webhooks(other.id)


def test_every_way_to_end_sends_completed(world: World):
    canceled, canceling, taken, expired = (world.job(webhook={**WEBHOOK, "events": ["completed"]}) for _ in range(4))
    world.store.request_cancel(canceled.id, world.tick())
    frame, _ = world.claim().frame, world.claim().frame
    world.store.request_cancel(canceling.id, world.tick())
    world.store.requeue_frame(world.fence, frame, world.tick())
    world.store.request_cancel(taken.id, world.tick())
    world.tick(1e7)
    world.lead("d2")
    world.store.expire(world.fence, world.now, 10)
    states = {canceled.id: "canceled", canceling.id: "canceled", taken.id: "canceled", expired.id: "expired"}
    for job_id, state in states.items():
        assert [one.payload["data"]["state"] for one in world.store.webhooks(job_id)] == [state]


def test_webhooks_are_due_until_they_are_delivered_or_given_up(world: World):
    jobs = [world.finished(webhook={**WEBHOOK, "events": ["completed"]}) for _ in range(3)]
    store, fence = world.store, world.fence
    due = store.due_webhooks(fence, world.now, 10)
    assert [one.job_id for one in due] == [job.id for job in jobs]
    assert len(store.due_webhooks(fence, world.now, 2)) == 2
    store.webhook_tried(fence, due[0].id, state="delivered", next_at=world.now, error="")
    for _ in range(2):  # the call repeated
        store.webhook_tried(fence, due[1].id, state="due", next_at=world.now + 60, error="503 \0")
    store.webhook_tried(fence, due[2].id, state="failed", next_at=world.now, error="410")
    store.webhook_tried(fence, due[2].id, state="due", next_at=world.now, error="late")
    store.webhook_tried(fence, "msg_none", state="due", next_at=world.now, error="")
    assert not store.due_webhooks(fence, world.now + 59, 10)
    (again,) = store.due_webhooks(fence, world.now + 60, 10)
    assert (again.id, again.tries, again.last_error) == (due[1].id, 1, "503 \ufffd")
    store.webhook_tried(fence, again.id, state="due", next_at=world.now + 120, error="503")
    assert store.webhooks(jobs[1].id)[0].tries == 2
    assert store.webhooks(jobs[0].id)[0].state == "delivered"
    assert store.webhooks(jobs[2].id)[0].state == "failed"
    with pytest.raises(Lost):
        store.due_webhooks(fence + 1, world.now, 10)
