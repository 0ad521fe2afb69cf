"""Servers that die or fall asleep at the worst moments, and others that go on: nothing is lost, nothing is there twice."""

from __future__ import annotations

import asyncio
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.service.dispatcher.play import play
from tests.service.dispatcher.rig import Rig, dispatching
from tests.service.dispatcher.scripted import ScriptedExecutor, Worker

from primray_service.dispatcher import lease as lease_module
from primray_service.jobs import FrameState, JobState
from primray_service.store.base import Lost
from primray_service.store.sql_store import SqlStore


@pytest.fixture
def short_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lease_module, "TTL_S", 1.0)
    monkeypatch.setattr(lease_module, "RENEW_EVERY_S", 0.3)
    monkeypatch.setattr(lease_module, "MARGIN_S", 0.2)


async def renders(worker: Worker) -> None:
    worker.sampling()
    worker.checkpoint()
    worker.done(pixels=worker.went_on_from.decode() or "first")


DIES_AT = ["accept_checkpoint", "end_frame", "report", "claim_frames"]


@pytest.mark.parametrize("method", DIES_AT)
@pytest.mark.parametrize("committed", [False, True], ids=["before", "after"])
def test_a_server_that_dies_there_is_followed_by_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str, committed: bool
) -> None:
    """As if it was killed just before the rows changed, or just after; whatever it knew is gone."""
    jobs: list[str] = []
    real = getattr(SqlStore, method)

    def dies(self: SqlStore, *args: Any, **kwargs: Any) -> Any:
        if committed:
            real(self, *args, **kwargs)
        raise Lost

    async def until_death(rig: Rig, executor: ScriptedExecutor) -> None:
        monkeypatch.setattr(SqlStore, method, dies)
        jobs.append(rig.submit(rig.scene()).id)
        await rig.until(lambda: rig.dispatcher.metrics.leases_lost > 0)
        monkeypatch.setattr(SqlStore, method, real)
        await rig.ended(jobs[0])

    async def at_the_end(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(jobs[0])
        assert job.state is JobState.SUCCEEDED
        assert len(rig.outputs(job.id)) == 3
        frame = rig.frame(job.id)
        left = {path.name for path in rig.data.frame(job.id, 0).iterdir()}
        assert left <= {Path(frame.checkpoint_file).name, "log.txt"}, left
        assert (rig.data.job(job.id) / frame.checkpoint_file).read_bytes().decode() == "123"[: frame.checkpoint]
        assert len(rig.events(job.id, "end")) == 1

    play(tmp_path, renders, until_death)
    play(tmp_path, renders, at_the_end)


@pytest.mark.usefixtures("short_lease")
def test_a_server_that_slept_through_its_lease_changes_nothing(tmp_path: Path) -> None:
    """Its event loop stands still while another takes over and ends the job; then its own worker's late results come in."""
    awake, asleep, taken = threading.Event(), threading.Event(), threading.Event()

    async def late(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint(b"late 1")
        await asyncio.sleep(0.2)
        worker.checkpoint(b"late 2")
        worker.done(pixels="late")
        asleep.set()
        awake.wait(20)  # blocks the loop, as a machine that is suspended does; what was said is heard after it

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        other = threading.Thread(target=take_over, args=(job.id,))
        other.start()
        await rig.until(taken.is_set)
        await asyncio.sleep(0.5)
        other.join()
        ended = rig.job(job.id)
        frame = rig.frame(job.id)
        assert (ended.state, frame.checkpoint) == (JobState.SUCCEEDED, 2)
        assert (rig.data.job(job.id) / frame.checkpoint_file).read_bytes() == b"late 12"
        assert {(rig.data.outputs(job.id) / o.name).read_text().split()[1] for o in rig.outputs(job.id)} == {"other"}
        assert len(rig.events(job.id, "end")) == 1

    async def other_renders(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        worker.done(pixels="other")

    def take_over(job_id: str) -> None:
        assert asleep.wait(10)

        async def run() -> None:
            async with dispatching(tmp_path, lambda data, limits: ScriptedExecutor(data, other_renders)) as rig:
                await rig.ended(job_id)

        try:
            asyncio.run(run())
        finally:
            awake.set()
            taken.set()

    play(tmp_path, late, act)


def test_two_servers_take_turns(tmp_path: Path) -> None:
    """Both wait for work all the time; every job is run by the one that has the lease, once."""

    async def run() -> None:
        executors: list[ScriptedExecutor] = []

        def make(data: Any, limits: Any) -> ScriptedExecutor:
            executors.append(ScriptedExecutor(data, renders))
            return executors[-1]

        async with dispatching(tmp_path, make) as first:
            await first.until(lambda: first.dispatcher.metrics.holds_lease)
            async with dispatching(tmp_path, make) as second:
                scene = first.scene()
                jobs = [second.submit(scene).id for _ in range(3)]
                await second.ended(*jobs)
                assert [len(executor.workers) for executor in executors] == [3, 0]
                await first.dispatcher.stop()
                more = [second.submit(scene).id for _ in range(3)]
                await second.ended(*more)
                assert [len(executor.workers) for executor in executors] == [3, 3]
                for job_id in jobs + more:
                    assert len(second.outputs(job_id)) == 3

    asyncio.run(run())


@pytest.mark.usefixtures("short_lease")
def test_a_lease_that_cannot_be_renewed_kills_its_workers_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The database is out of reach: before the lease is over, nothing of ours runs any more."""
    stuck = threading.Event()

    def hanging(real: Callable[..., Any]) -> Callable[..., Any]:
        def hangs(*args: Any) -> Any:
            if stuck.is_set():
                time.sleep(0.5)
                raise ConnectionError("no route to the database")
            return real(*args)

        return hangs

    # All that is asked of a lease, or it would be had anew, and the frame with it, before a loaded machine looks at the frame.
    for method in ("acquire_lease", "renew_lease", "release_lease"):
        monkeypatch.setattr(SqlStore, method, hanging(getattr(SqlStore, method)))

    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        await asyncio.sleep(0.1 if worker.number > 1 else 60)
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.until(lambda: rig.frame(job.id).checkpoint == 1)
        stuck.set()
        began = time.monotonic()
        await rig.until(lambda: not executor.running)
        assert time.monotonic() - began < 30  # of the minute that it renders
        assert rig.frame(job.id).state is FrameState.RUNNING, "what it could not write it did not write"
        stuck.clear()
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED
        assert rig.frame(job.id).checkpoint == 2

    play(tmp_path, script, act)


def test_files_of_dead_chunks_are_swept(tmp_path: Path) -> None:
    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.ended(job.id)

    async def sweeps(rig: Rig, executor: ScriptedExecutor) -> None:
        await rig.until(lambda: not orphan.exists())

    play(tmp_path, renders, act)
    orphan = tmp_path / "data" / "jobs" / "job_00000000000000000000000000"
    orphan.mkdir()
    os.utime(orphan, (1, 1))
    play(tmp_path, renders, sweeps)
    assert len(list((tmp_path / "data" / "jobs").iterdir())) == 1
