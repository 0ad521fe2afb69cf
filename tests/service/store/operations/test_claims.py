"""Which frame runs next, and that no two take the same."""

from __future__ import annotations

import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from primray_service.jobs import FrameState, JobState
from primray_service.limits import Quotas
from primray_service.queue.order import in_order
from primray_service.store import open_store
from primray_service.store.base import Claim, Lost
from primray_service.store.operations.open_job import open_jobs

from ..world import ANY, World, any_quotas, new_job, new_scene, scene_id


def test_priority_then_age_then_the_frames_in_order(world: World):
    low = world.job(priority=10)
    old = world.job(frames=2)
    young = world.job()
    high = world.job(priority=90)
    order = [(claim.job.id, claim.frame.number) for claim in (world.claim() for _ in range(5))]
    assert order == [(high.id, 0), (old.id, 0), (old.id, 1), (young.id, 0), (low.id, 0)]
    assert world.claims_nothing()


def test_of_equal_priority_who_has_fewest_frames_running_goes_first(world: World):
    first = [world.job("a"), world.job("a"), world.job("a")]
    b = world.job("b", frames=2)
    c = world.job("c")
    high = world.job("a", priority=60)
    order = [world.claim().job.id for _ in range(7)]
    assert order == [high.id, b.id, c.id, first[0].id, b.id, first[1].id, first[2].id]


def test_what_ended_makes_room_for_its_tenant(world: World):
    a = [world.job("a"), world.job("a")]
    b = [world.job("b"), world.job("b")]
    first = world.claim()
    assert first.job.id == a[0].id
    assert world.claim().job.id == b[0].id
    world.end(first.frame)
    assert world.claim().job.id == a[1].id


def test_a_claim_says_what_runs(world: World):
    job = world.job(frames=2)
    claim = world.claim()
    assert (claim.job.state, claim.frame.state, claim.frame.started_at) == (JobState.PREPARING, FrameState.RUNNING, world.now)
    assert claim.job == world.get(job)
    assert claim.frame == world.store.frame(job.id, 0)
    assert world.claim().frame.number == 1
    assert world.states(job) == ["queued", "preparing"]


def test_a_job_waits_for_its_scene(world: World):
    world.store.put_scene(new_scene(), ANY)
    world.store.create_job(new_job(), [None], ANY)
    assert world.claims_nothing()
    assert not world.store.waiting(world.fence)
    world.store.scene_checked(world.fence, scene_id(), world.tick(), facts={}, warnings=[], problem=None)
    assert world.store.waiting(world.fence) == [(50, "t")]
    assert world.claim()


def test_running_jobs_are_within_the_quota_but_go_on(world: World):
    quotas = {"a": Quotas(running_jobs=1), "b": ANY}
    begun = world.job("a", frames=3)
    world.job("a", priority=99)
    other = world.job("b")
    world.store.update_job(begun.id, world.tick(), version=None, changes={"priority": 100})

    def claim():
        return world.store.claim_frame(world.fence, world.tick(), quotas.__getitem__)

    assert claim().job.id == begun.id
    world.store.update_job(begun.id, world.tick(), version=None, changes={"priority": 40})
    assert world.store.waiting(world.fence, world.now, quotas.__getitem__) == [(50, "b"), (40, "a")]
    assert world.store.waiting(world.fence) == [(99, "a"), (50, "b")]
    assert claim().job.id == other.id
    second = claim()
    assert (second.job.id, second.frame.number) == (begun.id, 1)
    for frame in world.store.frames(begun.id)[:2]:
        world.end(frame)
    assert (claim().job.id, claim()) == (begun.id, None)  # between its frames, too, it is the one that runs


def test_who_used_up_the_days_seconds_waits_for_tomorrow(world: World):
    quotas = {"a": Quotas(cpu_s_per_day=10.0), "b": ANY}
    world.job("a", frames=2, priority=90)
    other = world.job("b")
    world.end(replace(world.claim().frame, cpu_s=10.0))
    assert world.claim_within(quotas.__getitem__).job.id == other.id
    assert not world.store.waiting(world.fence, world.now, quotas.__getitem__)
    assert world.store.claim_frame(world.fence, world.tick(), quotas.__getitem__) is None
    world.tick(24 * 3600)
    assert world.claim_within(quotas.__getitem__).job.tenant == "a"


def test_a_changed_priority_changes_the_queue(world: World):
    world.job()
    late = world.job()
    world.store.update_job(late.id, world.tick(), version=None, changes={"priority": 51})
    assert world.store.waiting(world.fence) == [(51, "t")]
    assert world.claim().job.id == late.id


def test_without_the_lease_nothing_is_claimed(world: World):
    world.job()
    for call in (lambda f: world.store.claim_frame(f, world.now, any_quotas), world.store.waiting):
        with pytest.raises(Lost):
            call(world.fence + 1)


def test_a_claim_whose_answer_was_lost_is_given_again(world: World, monkeypatch: pytest.MonkeyPatch):
    """The commit arrives, and the caller is told of a failure: its next call gets the frame that nobody knows of."""
    world.job(frames=2)
    write = world.store._db.write

    def fails(work, **options):
        write(work, **options)
        raise ConnectionError

    with monkeypatch.context() as patch:
        patch.setattr(world.store._db, "write", fails)
        with pytest.raises(ConnectionError):
            world.claim()
    assert world.claim().frame.number == 0
    assert world.claim().frame.number == 1


def test_many_claim_at_once_and_each_frame_is_claimed_once(url: str, world: World):
    """Two stores, as of two dispatchers that both think they lead, eight threads; jobs are canceled meanwhile."""
    jobs = [world.job(f"t{number % 3}", frames=4, priority=50 + number % 2) for number in range(12)]
    other = open_store(url)
    claimed: list[tuple[str, int]] = []
    start = threading.Barrier(9)

    def claim_all(store) -> None:
        start.wait()
        while (claim := store.claim_frame(world.fence, world.now, any_quotas)) is not None:
            claimed.append((claim.job.id, claim.frame.number))

    def cancel_some() -> None:
        start.wait()
        for job in jobs[::4]:
            world.store.request_cancel(job.id, world.now)

    with ThreadPoolExecutor(9) as pool:
        done = [pool.submit(claim_all, store) for store in [world.store, other] * 4]
        done.append(pool.submit(cancel_some))
        for one in done:
            one.result()
    other.close()
    assert max(Counter(claimed).values()) == 1
    counts = Counter(frame.state for job in jobs for frame in world.store.frames(job.id))
    assert counts[FrameState.QUEUED] == 0
    assert counts[FrameState.RUNNING] == len(claimed) >= 36


def test_a_dispatcher_that_lost_the_lease_in_between_claims_nothing(url: str, world: World):
    """It passed its look at the fence, and another took over before its transaction began."""
    world.job()
    other = open_store(url)
    old = world.fence
    write = world.store._db.write
    taken: list[int | None] = []

    def late(work, **options):
        if not taken:
            taken.append(other.acquire_lease("d2", world.now + 1e7, 10))
        return write(work, **options)

    world.store._db.write = late  # type: ignore[method-assign]
    with pytest.raises(Lost):
        world.store.claim_frame(old, world.tick(), any_quotas)
    other.close()
    assert taken == [old + 1]


def test_jobs_are_begun_in_the_order_that_clients_are_told(world: World):
    """As `in_order` says at the beginning, with nothing ending meanwhile."""
    for tenant, priority, frames in [("a", 50, 3), ("a", 50, 1), ("b", 50, 1), ("b", 90, 2), ("c", 10, 1), ("c", 50, 1)]:
        world.job(tenant, frames=frames, priority=priority)
    running = world.claim()
    queue = world.store.queue(100)
    assert [(job.id, frames) for job, frames in queue.active] == [(running.job.id, 1)]
    assert [(job.frames, job.begun) for job in queue.waiting if job.job_id == running.job.id] == [(1, True)]
    told = [job.job_id for job in in_order(queue.waiting, Counter({running.job.tenant: 1}))]
    begun = [world.claim().job.id for _ in range(sum(job.frames for job in queue.waiting))]
    assert list(dict.fromkeys(begun)) == told
    assert world.store.queue(100).waiting == []
    assert len(world.store.queue(100).active) == 6


def test_a_long_queue_is_read_in_part(world: World):
    low = [world.job(priority=10) for _ in range(2)]
    high = world.job(priority=90)
    assert [job.job_id for job in world.store.queue(2).waiting] == [high.id, low[0].id]


def test_several_at_once_are_those_of_one_after_another(world: World):
    for i, (tenant, priority, frames) in enumerate([("a", 50, 30), ("b", 50, 1), ("b", 50, 2), ("c", 70, 2), ("c", 50, 1)]):
        for _ in range(1 + i % 2):
            world.job(tenant, frames=frames, priority=priority)
    quotas = {"a": ANY, "b": Quotas(running_jobs=2), "c": ANY}
    served = {"a": 2, "b": 1}
    for most in (1, 2, 5, 9, 40, 100):
        at_once = world.store.claim_frames(world.fence, world.tick(), quotas.__getitem__, most, served)
        for claim in at_once:
            world.store.requeue_frame(world.fence, claim.frame, world.tick())
        alone: list[Claim] = []
        turns = dict(served)
        while len(alone) < most:
            claims = world.store.claim_frames(world.fence, world.tick(), quotas.__getitem__, 1, turns)
            if not claims:
                break
            alone += claims
            turns[claims[0].job.tenant] = 3 + len(alone)
        for claim in alone:
            world.store.requeue_frame(world.fence, claim.frame, world.tick())
        assert {claim.frame.job_id: 0 for claim in at_once} == {claim.frame.job_id: 0 for claim in alone}
        assert {(c.frame.job_id, c.frame.number) for c in at_once} == {(c.frame.job_id, c.frame.number) for c in alone}
        assert len(at_once) == len(alone) == min(most, 37)


def test_each_of_several_says_what_runs(world: World):
    jobs = [world.job(frames=3), world.job(frames=1)]
    claims = world.store.claim_frames(world.fence, world.tick(), any_quotas, 10)
    assert [(claim.job.id, claim.frame.number) for claim in claims] == [
        (jobs[0].id, 0),
        (jobs[0].id, 1),
        (jobs[0].id, 2),
        (jobs[1].id, 0),
    ]
    for claim in claims:
        assert claim.job == world.get(claim.job)
        assert claim.frame == world.store.frame(claim.frame.job_id, claim.frame.number)
    assert world.states(jobs[0]) == ["queued", "preparing"]
    assert world.claims_nothing()


def test_those_whose_answer_was_lost_are_given_again(world: World, monkeypatch: pytest.MonkeyPatch):
    jobs = [world.job(frames=2), world.job("u"), world.job("v")]
    write = world.store._db.write

    def fails(work, **options):
        write(work, **options)
        raise ConnectionError

    with monkeypatch.context() as patch:
        patch.setattr(world.store._db, "write", fails)
        with pytest.raises(ConnectionError):
            world.store.claim_frames(world.fence, world.tick(), any_quotas, 3)
    again = world.store.claim_frames(world.fence, world.tick(), any_quotas, 1)
    assert {claim.job.id for claim in again} == {job.id for job in jobs}
    assert world.claim().frame.number == 1
    assert world.claims_nothing()


def test_a_job_in_parts_is_the_last_of_several(world: World):
    first, parts = world.job(), world.job(parallel="auto", frames=2)
    world.job()
    claims = world.store.claim_frames(world.fence, world.tick(), any_quotas, 10)
    assert [claim.job.id for claim in claims] == [first.id, parts.id]


def test_a_job_canceled_meanwhile_is_left_out(world: World, monkeypatch: pytest.MonkeyPatch):
    """Between the look at the queue and the lock."""
    gone, stays = world.job(), world.job()

    def late(transaction, job_ids):
        if list(job_ids) == [gone.id, stays.id]:
            other = open_store(str(world.store._db.url.render_as_string(hide_password=False)))
            other.request_cancel(gone.id, world.now)
            other.close()
        return open_jobs(transaction, job_ids)

    if world.store._db.is_sqlite:
        pytest.skip("skipped: a writer of SQLite is alone")
    monkeypatch.setattr("primray_service.store.operations.claims.open_jobs", late)
    claims = world.store.claim_frames(world.fence, world.tick(), any_quotas, 10)
    assert [claim.job.id for claim in claims] == [stays.id]


def test_versions_of_jobs(world: World):
    jobs = [world.job(), world.job("u")]
    changed = world.store.update_job(jobs[1].id, world.tick(), version=None, changes={"priority": 9})
    assert world.store.job_versions([jobs[0].id, jobs[1].id, "job_none"]) == {jobs[0].id: 1, jobs[1].id: changed.version}
    assert world.store.job_versions([]) == {}


def test_who_holds_slots_is_the_dispatchers_to_say(world: World):
    """A frame whose slot is free already, and whose row says that it runs still, is not held against its tenant."""
    a, b = world.job("a", frames=2), world.job("b")
    assert world.claim().job.id == a.id
    again = world.store.claim_frames(world.fence, world.tick(), any_quotas, 1, {}, {"a": 0, "b": 0})
    assert [claim.job.id for claim in again] == [a.id]
    assert world.claim().job.id == b.id
