"""Connections cut, servers restarted, processes killed, at random: nothing that was accepted is lost, nothing counts twice."""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import psycopg
import pytest

from primray_service.jobs import FrameState, JobState
from primray_service.store import open_store
from primray_service.store.base import JobFilter

from ...postgres import Server, private_server
from ..conftest import database_of
from ..operations.test_tenants import WEBHOOK
from ..world import ANY, T0, World, any_quotas, broken_rules, new_job

CPU_S = 1.25  # of each frame, in two reports


def disturbed(url: str, disturb: Callable[[], None], jobs: int, clients: int) -> None:
    """Clients make jobs, cancel some, read; a dispatcher runs them; `disturb` is called over and over meanwhile."""
    store = open_store(url)
    store.migrate()
    world = World(store)
    world.lead()
    world.ready_scene()
    over = threading.Event()

    def client(number: int) -> list[str]:
        mine = []
        for turn in range(jobs // clients):
            name = f"{number} {turn}"
            job = new_job(at=T0 + turn, webhook={**WEBHOOK, "events": ["completed"]}, labels={"name": name})
            made, is_new = store.create_job(job, [None, None], ANY, (name, "request"))
            assert is_new
            assert made.id == job.id
            changed = store.update_job(job.id, T0, version=None, changes={"labels": {"name": name, "changed": "1"}})
            assert changed.labels["changed"] == "1"
            assert [found.id for found in store.jobs("t", JobFilter(labels={"name": name}), 5, None).items] == [job.id]
            mine.append(job.id)
        return mine

    def dispatcher() -> None:
        ended = 0
        while ended < jobs:
            claim = store.claim_frame(world.fence, T0, any_quotas)
            if claim is None:
                time.sleep(0.01)
                continue
            frame, now = claim.frame, T0 + 100 * ended + claim.frame.number
            job_id, number = frame.job_id, frame.number
            half = replace(frame, cpu_s=CPU_S / 2)
            store.report(world.fence, half, now, job_changes={"state": JobState.RUNNING}, events=[("progress", {"n": number})])
            given: Any = {"attempt": 1, "follows": 0, "file": "checkpoint-1.prc", "now": now}
            assert store.accept_checkpoint(world.fence, f"{job_id} {number}", job_id, number, **given)
            done = replace(frame, state=FrameState.SUCCEEDED, cpu_s=CPU_S, checkpoint=1)
            job = store.end_frame(world.fence, done, now, outputs=[], job_changes={})
            ended += job.state == JobState.SUCCEEDED

    def keep_disturbing() -> None:
        while not over.is_set():
            disturb()

    with ThreadPoolExecutor(clients + 2) as pool:
        disturbing = pool.submit(keep_disturbing)
        try:
            running = pool.submit(dispatcher)
            made = [job_id for one in [pool.submit(client, number) for number in range(clients)] for job_id in one.result()]
            running.result()
        finally:
            over.set()
        disturbing.result()

    assert len(made) == jobs
    assert store.counts()["succeeded"] == jobs
    assert store.usage("t", T0).cpu_s_total == jobs * 2 * CPU_S
    usual = Counter({"state": 4, "progress": 2, "frame": 4, "end": 1})
    for job_id in made:
        assert Counter(event.type for event in store.events(job_id, 0, 100)) == usual
        assert len(store.webhooks(job_id)) == 1
        assert [frame.checkpoint for frame in store.frames(job_id)] == [1, 1]
    assert not broken_rules(store)
    store.close()


def cutter(server: Server, database: str, rng: random.Random, kills: list[int], most: int) -> Callable[[], None]:
    """So many cuts: on a busy machine a transaction may take longer than the time between two."""
    with_ = server.admin_url.replace("+psycopg", "")
    connection = psycopg.connect(with_, autocommit=True)
    one = (
        "SELECT pg_terminate_backend(pid) FROM "
        "(SELECT pid FROM pg_stat_activity WHERE datname = %s ORDER BY random() LIMIT %s) AS chosen"
    )

    def cut() -> None:
        time.sleep(rng.uniform(0.0, 0.15))
        if len(kills) < most:
            kills.append(len(connection.execute(one, (database, rng.choice((1, 1, 2, 50)))).fetchall()))

    return cut


def test_connections_are_cut_at_random(postgres_server: Server, postgres_url: str):
    kills: list[int] = []
    cut = cutter(postgres_server, database_of(postgres_url), random.Random(1), kills, 25)
    disturbed(postgres_url, cut, jobs=24, clients=4)
    assert sum(kills) >= 8


@pytest.mark.long
def test_connections_are_cut_at_random_for_long(postgres_server: Server, postgres_url: str):
    kills: list[int] = []
    cut = cutter(postgres_server, database_of(postgres_url), random.Random(2), kills, 400)
    disturbed(postgres_url, cut, jobs=400, clients=8)
    print(f"{sum(kills)} connections cut")
    assert sum(kills) >= 200


@pytest.mark.long
def test_the_database_server_crashes_and_comes_back():
    """Not synced to disk is fine here: the processes die, not the machine."""
    rng = random.Random(3)
    restarts = []
    with private_server() as server:

        def restart() -> None:
            time.sleep(rng.uniform(0.5, 2.0))
            server.stop(rng.choice(("immediate", "fast")))
            time.sleep(rng.choice((0.0, 0.0, 3.0)))
            server.start()
            restarts.append(1)

        url = server.url_of(server.new_database())
        disturbed(url, restart, jobs=1200, clients=6)
    print(f"{len(restarts)} restarts")
    assert len(restarts) >= 3


def write_on_and_on(url: str, now: float, said: int) -> None:
    """The process that is to be killed: a server's work, each thing told when it is done."""

    def say(*words: object) -> None:
        os.write(said, (" ".join(map(str, words)) + "\n").encode())

    store = open_store(url)
    world = World(store, now=now)
    world.lead("process", ttl_s=1.0)
    world.ready_scene()
    while True:
        say("made", world.job(frames=2, priority=1).id)
        for _ in range(2):
            frame = world.claim().frame
            world.begin(frame, progress={"fraction": 0.5})
            say("ended", frame.job_id, frame.number, world.end(replace(frame, cpu_s=1.0)).state)


def test_a_process_that_writes_to_sqlite_is_killed(tmp_path: Path):
    """What it said that it had done is there when the database is opened again, and all of it fits together."""
    rng = random.Random(4)
    path = tmp_path / "primray.sqlite"
    store = open_store(f"sqlite:///{path}")
    store.migrate()
    store.close()
    made: set[str] = set()
    ended: dict[tuple[str, int], str] = {}
    for turn in range(12):
        for line in lines_of_one_that_is_killed(f"sqlite:///{path}", T0 + 1e6 * turn, rng):
            what, job_id, *rest = line.split()
            if what == "made":
                made.add(job_id)
            else:
                ended[job_id, int(rest[0])] = rest[1]
        store = open_store(f"sqlite:///{path}")
        assert not broken_rules(store)
        for job_id in made:
            assert store.job(job_id) is not None
        for (job_id, number), state in ended.items():
            frame, job = store.frame(job_id, number), store.job(job_id)
            assert frame is not None
            assert job is not None
            assert frame.state == FrameState.SUCCEEDED
            assert state != "succeeded" or job.state == JobState.SUCCEEDED
        store.close()
    assert len(made) >= 12
    with sqlite3.connect(path) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


def lines_of_one_that_is_killed(url: str, now: float, rng: random.Random) -> list[str]:
    """All that it said, after so many lines and a moment."""
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        try:
            write_on_and_on(url, now, writing)
        finally:
            os._exit(1)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        said = [pipe.readline() for _ in range(rng.randint(1, 8))]
        time.sleep(rng.uniform(0.0, 0.02))
        os.kill(process, signal.SIGKILL)
        said += pipe.readlines()
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == -signal.SIGKILL
    return [line.decode() for line in said if line.endswith(b"\n")]


def test_accepted_jobs_are_synced_progress_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """SQLite syncs its log at a commit only with synchronous=FULL (2); at checkpoints with NORMAL (1) too."""
    store = open_store(f"sqlite:///{tmp_path / 'primray.sqlite'}")
    store.migrate()
    world = World(store)
    world.lead()
    levels: list[int] = []
    writing = store._db._writing

    def watched(durable: bool):
        class Watched:
            def __enter__(self):
                self.inner = writing(durable)
                connection = self.inner.__enter__()
                levels.append(connection.exec_driver_sql("PRAGMA synchronous").scalar_one())
                return connection

            def __exit__(self, *error):
                return self.inner.__exit__(*error)

        return Watched()

    monkeypatch.setattr(store._db, "_writing", watched)
    world.ready_scene()
    levels.clear()
    world.job()
    assert levels == [2]
    frame = world.claim().frame
    world.begin(frame)
    assert levels == [2, 1, 1]
    store.accept_checkpoint(world.fence, "c", frame.job_id, 0, attempt=1, follows=0, file="f", now=world.now)
    world.end(frame)
    assert levels[3:] == [2, 2]
    store.close()
