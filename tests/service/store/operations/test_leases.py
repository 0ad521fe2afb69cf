"""One dispatcher at a time, and nothing of an earlier one's is written."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from primray_service.jobs import FrameState, JobState
from primray_service.store import SqlStore, open_store
from primray_service.store.base import Lost

from ..world import T0, World, any_quotas, scene_id


def test_one_holds_the_lease_until_its_time_is_over(store: SqlStore):
    assert store.lease_expires_at() is None
    first = store.acquire_lease("a", T0, 10)
    assert first is not None
    assert store.acquire_lease("a", T0, 10) == first  # the call repeated
    assert store.acquire_lease("b", T0 + 9.9, 10) is None
    assert store.lease_expires_at() == T0 + 10
    store.renew_lease(first, T0 + 9, 10)
    assert store.acquire_lease("b", T0 + 18, 10) is None
    second = store.acquire_lease("b", T0 + 19, 10)
    assert second is not None
    assert second > first
    with pytest.raises(Lost):
        store.renew_lease(first, T0 + 19, 10)
    store.release_lease(first)  # not its own any more
    assert store.lease_expires_at() == T0 + 29
    store.release_lease(second)
    assert store.lease_expires_at() is None
    with pytest.raises(Lost):
        store.renew_lease(second, T0 + 20, 10)
    third = store.acquire_lease("a", T0 + 20, 10)
    assert third is not None
    assert third > second


def test_of_many_one_gets_it(url: str, store: SqlStore):
    stores = [open_store(url) for _ in range(4)]

    def acquire(number: int) -> int | None:
        return stores[number % 4].acquire_lease(f"d{number}", T0, 10)

    with ThreadPoolExecutor(8) as pool:
        got = [fence for fence in pool.map(acquire, range(16)) if fence is not None]
    for opened in stores:
        opened.close()
    assert len(got) == 1


def test_a_dead_dispatchers_frames_wait_again(world: World):
    running, canceling, between = world.job(frames=3), world.job(frames=2), world.job(frames=2)
    frames = [world.claim().frame for _ in range(2)]
    world.begin(frames[0])
    world.store.accept_checkpoint(
        world.fence, "c", running.id, 0, attempt=1, follows=0, file="checkpoint-1.prc", now=world.tick()
    )
    world.claim()
    world.claim()
    world.store.request_cancel(canceling.id, world.tick())
    world.end(world.claim().frame)
    assert world.get(between).state == JobState.PREPARING
    old = world.fence
    world.tick(1e7)
    assert world.lead("d2") > old

    assert [world.get(job).state for job in (running, canceling, between)] == [
        JobState.QUEUED,
        JobState.CANCELED,
        JobState.QUEUED,
    ]
    assert world.states(running) == ["queued", "preparing", "running", "queued"]
    frame = world.claim().frame
    assert (frame.job_id, frame.number, frame.checkpoint, frame.kills) == (running.id, 0, 1, 0)
    assert world.store.frame_counts(canceling.id)["canceled"] == 2


def test_nothing_is_written_under_a_fence_of_before(world: World):
    world.job()
    frame = world.claim().frame
    old = world.fence
    world.tick(1e7)
    world.lead("d2")
    store, now = world.store, world.now
    before = store.job(frame.job_id)
    calls = [
        lambda: store.renew_lease(old, now, 10),
        lambda: store.claim_frame(old, now, any_quotas),
        lambda: store.waiting(old),
        lambda: store.report(old, frame, now, events=[("progress", {})]),
        lambda: store.accept_checkpoint(old, "c", frame.job_id, 0, attempt=1, follows=0, file="f", now=now),
        lambda: store.end_frame(old, replace(frame, state=FrameState.SUCCEEDED), now, outputs=[], job_changes={}),
        lambda: store.requeue_frame(old, frame, now),
        lambda: store.next_check(old),
        lambda: store.scene_checked(old, scene_id(), now, facts={}, warnings=[], problem=None),
        lambda: store.expire(old, now, 10),
        lambda: store.unused_scenes(old, now, 10),
        lambda: store.due_webhooks(old, now, 10),
        lambda: store.webhook_tried(old, "msg", state="delivered", next_at=now, error=""),
    ]
    for call in calls:
        with pytest.raises(Lost):
            call()
    assert store.job(frame.job_id) == before
