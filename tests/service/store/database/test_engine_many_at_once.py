"""Many threads: nobody is told that the database is busy, nobody sees half of a change, readers do not wait for writers."""

from __future__ import annotations

import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

from primray_service.jobs import TERMINAL, FrameState
from primray_service.limits import Quotas
from primray_service.store import open_store
from primray_service.store.base import JobFilter, QuotaExceeded

from ..world import ANY, World, any_quotas, new_job


def test_forty_threads_write_and_read(url: str, world: World):
    for tenant in ("t", "u"):
        world.ready_scene(tenant)
    other = open_store(url)  # another process's, as far as SQLite's locks are concerned
    start = threading.Barrier(40)

    def client(number: int) -> int:
        store = (world.store, other)[number % 2]
        start.wait()
        seen = 0
        for turn in range(4):
            job, _ = store.create_job(new_job("tu"[number % 2]), [None], ANY, (f"{number} {turn}", "r"))
            changed = store.update_job(job.id, world.now, version=None, changes={"labels": {"n": str(number)}})
            seen += store.job(job.id) is not None and changed.labels == {"n": str(number)}
            seen += len(store.jobs("tu"[number % 2], JobFilter(), 5, None).items) > 0
            if turn == 3:
                store.request_cancel(job.id, world.now)
        return seen

    def dispatcher() -> int:
        start.wait()
        ended = 0
        while ended < 40:
            claim = world.store.claim_frame(world.fence, world.now, any_quotas)
            if claim is not None:
                job = world.begin(claim.frame)
                ended += world.end(claim.frame, FrameState.SUCCEEDED).state in TERMINAL or job.state in TERMINAL
        return ended

    with ThreadPoolExecutor(40) as pool:
        leading = pool.submit(dispatcher)
        clients = [pool.submit(client, number) for number in range(39)]
        assert [one.result() for one in clients] == [8] * 39
        assert leading.result() == 40
    other.close()
    assert sum(world.store.counts().values()) == 39 * 4


def test_readers_of_sqlite_do_not_wait_for_a_writer(world: World):
    job = world.job()
    inside, go_on = threading.Event(), threading.Event()

    def slow(transaction):
        inside.set()
        go_on.wait(30)

    with ThreadPoolExecutor(1) as pool:
        writing = pool.submit(world.store._db.write, slow)
        inside.wait(30)
        started = time.monotonic()
        assert world.get(job) == job
        assert world.store.jobs("t", JobFilter(), 5, None).items == [job]
        assert world.store.counts()["queued"] == 1
        waited = time.monotonic() - started
        go_on.set()
        writing.result()
    assert waited < 5


def test_the_last_place_of_a_quota_is_taken_once(url: str, world: World):
    world.ready_scene()
    other = open_store(url)
    quotas = Quotas(queued_jobs=5)

    def make(number: int) -> bool:
        try:
            (world.store, other)[number % 2].create_job(new_job(), [None], quotas)
        except QuotaExceeded:
            return False
        return True

    with ThreadPoolExecutor(12) as pool:
        assert Counter(pool.map(make, range(24))) == {True: 5, False: 19}
    other.close()


def test_one_idempotency_key_makes_one_job(url: str, world: World):
    world.ready_scene()
    other = open_store(url)

    def make(number: int) -> tuple[str, bool]:
        job, is_new = (world.store, other)[number % 2].create_job(new_job(), [None], ANY, ("key", "request"))
        return job.id, is_new

    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(make, range(16)))
    other.close()
    assert len({job_id for job_id, _ in made}) == 1
    assert sum(is_new for _, is_new in made) == 1


def test_a_reader_never_finds_an_earlier_event_later(url: str, world: World):
    """Several write to one job, several follow its events as a stream does: by the last number seen."""
    job = world.job(frames=6)
    frames = [world.claim().frame for _ in range(6)]
    stores = [world.store, *(open_store(url) for _ in range(2))]
    done = threading.Event()

    def write(number: int) -> None:
        for turn in range(15):
            stores[number % 3].report(
                world.fence, frames[number], world.now, events=[("progress", {"n": number, "turn": turn})]
            )

    def follow(number: int) -> list[int]:
        seen: list[int] = []
        while True:
            last = done.is_set()
            seen += [event.id for event in stores[number % 3].events(job.id, seen[-1] if seen else 0, 1000)]
            if last:
                return seen

    with ThreadPoolExecutor(9) as pool:
        followers = [pool.submit(follow, number) for number in range(3)]
        for one in [pool.submit(write, number) for number in range(6)]:
            one.result()
        done.set()
        everything = [event.id for event in world.store.events(job.id, 0, 10_000)]
        assert len(everything) == 2 + 6 + 6 * 15
        for follower in followers:
            assert follower.result() == everything
    for store in stores[1:]:
        store.close()
