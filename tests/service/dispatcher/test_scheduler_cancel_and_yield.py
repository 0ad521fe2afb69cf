"""Canceling, giving way, shutting down and running out of time or disk, by scripted workers."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest
from tests.service.dispatcher.play import QUICKLY_S, play
from tests.service.dispatcher.rig import Rig
from tests.service.dispatcher.scripted import ScriptedExecutor, Worker

from primray_service.files import DataDirectory
from primray_service.jobs import FrameState, JobState

pytestmark = pytest.mark.usefixtures("no_wait_ends")


async def until_told(worker: Worker) -> None:
    """Renders until it is told to stop or to give way."""
    worker.sampling()
    told = await worker.hears("stop", "yield")
    worker.checkpoint()
    if told == "stop":
        worker.done("interrupted")
    else:
        worker.say("yielded", number=worker.number)


async def is_running(rig: Rig, job_id: str) -> None:
    await rig.until(lambda: rig.job(job_id).state is JobState.RUNNING)


def test_cancel_keeps_the_picture(tmp_path: Path) -> None:
    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), time_codes=(1.0, 2.0))
        await is_running(rig, job.id)
        asked = time.monotonic()
        assert rig.store.request_cancel(job.id, time.time()).state is JobState.CANCELING
        rig.dispatcher.wake()
        [ended] = await rig.ended(job.id)
        assert time.monotonic() - asked < QUICKLY_S
        assert ended.state is JobState.CANCELED
        assert len(rig.outputs(job.id)) == 3
        assert ended.result is not None
        assert ended.result["stop"]["reason"] == "interrupted"
        assert ended.progress["frames"]["canceled"] == 2
        assert ended.error is None
        assert rig.frame(job.id).state is FrameState.CANCELED

    assert len(play(tmp_path, until_told, act, stop_grace_s=60.0).workers) == 1


def test_cancel_while_loading_kills(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.say("phase", phase="opening")
        await asyncio.sleep(60)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.until(lambda: len(executor.workers) == 1)
        rig.store.request_cancel(job.id, time.time())
        rig.dispatcher.wake()
        asked = time.monotonic()
        [ended] = await rig.ended(job.id)
        assert time.monotonic() - asked < QUICKLY_S
        assert ended.state is JobState.CANCELED
        assert ended.result is None
        assert rig.outputs(job.id) == []

    play(tmp_path, script, act)


def test_a_worker_that_does_not_stop_leaves_its_checkpoints_picture(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        if worker.command["picture_only"]:
            worker.done("interrupted")
            return
        worker.sampling()
        worker.checkpoint()
        await asyncio.sleep(60)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await is_running(rig, job.id)
        rig.store.request_cancel(job.id, time.time())  # nobody wakes the dispatcher: it looks by itself
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.CANCELED
        assert len(rig.outputs(job.id)) == 3

    executor = play(tmp_path, script, act, stop_grace_s=0.2)
    assert [(worker.told, worker.went_on_from) for worker in executor.workers] == [(["stop"], b""), ([], b"1")]


def test_higher_priority_goes_first_and_the_other_goes_on(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        if worker.command["settings"]["seed"] == 1 or worker.went_on_from:
            worker.sampling()
            worker.done()
        else:
            await until_told(worker)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        low = rig.submit(rig.scene(), priority=10)
        await is_running(rig, low.id)
        high = rig.submit(rig.scene(), priority=11, settings={"seed": 1})
        first, second = await rig.ended(high.id, low.id)
        assert (first.state, second.state) == (JobState.SUCCEEDED, JobState.SUCCEEDED)
        assert second.attempt == 1
        assert rig.dispatcher.metrics.restarts == {"yield": 1}

    executor = play(tmp_path, script, act)
    assert [worker.went_on_from for worker in executor.workers] == [b"", b"", b"1"]


def test_tenants_of_equal_priority_take_turns(tmp_path: Path) -> None:
    """Three on one slot: each gets a slice in turn, and nobody waits for two others to finish."""
    order: list[str] = []

    async def script(worker: Worker) -> None:
        order.append(str(worker.command["settings"]["seed"]))
        if len(worker.went_on_from) == 2:
            worker.sampling()
            worker.done()
        else:
            await until_told(worker)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        scenes = [rig.scene(tenant=tenant) for tenant in ("a", "b", "c")]
        jobs = [rig.submit(scene, settings={"seed": i}) for i, scene in enumerate(scenes)]
        await rig.ended(*(job.id for job in jobs))

    play(tmp_path, script, act, time_slice_s=0.3)
    assert order == ["0", "1", "2"] * 3


def test_a_tenant_alone_is_not_interrupted(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        await asyncio.sleep(0.8)
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        scene = rig.scene()
        jobs = [rig.submit(scene) for _ in range(3)]
        await rig.ended(*(job.id for job in jobs))
        # Here, not after `play`: a stop of the dispatcher may meet the last worker on its way out, and tell it to yield.
        assert [worker.told for worker in executor.workers] == [[], [], []]

    executor = play(tmp_path, script, act, time_slice_s=0.1)
    assert executor.most_running == 1


def test_stop_lets_frames_write_a_checkpoint_and_gives_the_lease_back(tmp_path: Path) -> None:
    jobs: list[str] = []

    async def starts(rig: Rig, executor: ScriptedExecutor) -> None:
        jobs.append(rig.submit(rig.scene()).id)
        await is_running(rig, jobs[0])
        began = time.monotonic()
        await rig.dispatcher.stop()
        assert time.monotonic() - began < QUICKLY_S
        assert rig.job(jobs[0]).state is JobState.QUEUED
        assert rig.frame(jobs[0]).checkpoint == 1
        assert rig.store.lease_expires_at() is None

    async def renders(worker: Worker) -> None:
        assert worker.went_on_from == b"1"
        worker.sampling()
        worker.done()

    async def goes_on(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(jobs[0])
        assert job.state is JobState.SUCCEEDED

    assert play(tmp_path, until_told, starts).workers[0].told == ["yield"]
    play(tmp_path, renders, goes_on)


def test_stop_kills_who_does_not_give_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.dispatcher.scheduler.STOP_WITHIN_S", 0.3)

    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        await asyncio.sleep(60)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.until(lambda: rig.frame(job.id).checkpoint == 1)
        await rig.dispatcher.stop()
        assert (rig.job(job.id).state, rig.frame(job.id).kills) == (JobState.QUEUED, 0)

    play(tmp_path, script, act)


def test_an_expired_job_is_killed_and_deleted_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.dispatcher.retention.EXPIRE_EVERY_S", 0.1)

    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        await asyncio.sleep(60)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), ttl_s=1.0)
        await is_running(rig, job.id)
        folder = rig.data.job(job.id)
        assert folder.exists()
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.EXPIRED
        assert ended.error is not None
        assert ended.error["type"] == "/problems/job-expired"
        await rig.until(lambda: not executor.running)
        await rig.until(lambda: rig.store.job(job.id) is None and not folder.exists())

    play(tmp_path, script, act)


def test_a_full_disk_starts_nothing_and_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray_service.dispatcher.scheduler.LOOK_AT_DISK_EVERY_S", 0.05)
    free = [2**30]
    monkeypatch.setattr(DataDirectory, "free_bytes", lambda self: free[0])

    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        if worker.number == 1:
            free[0] = 0
            await asyncio.sleep(0.2)
            worker.fails("storage-limit", "No space left on device.")
        else:
            worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.until(lambda: rig.job(job.id).state is JobState.QUEUED and rig.frame(job.id).checkpoint == 1)
        await asyncio.sleep(0.7)
        assert len(executor.workers) == 1
        assert rig.job(job.id).state is JobState.QUEUED
        free[0] = 2**30
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED

    play(tmp_path, script, act, free_disk_bytes=2**20)


def test_previews_are_asked_for_and_told(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        await worker.hears("preview")
        worker.write("preview.raw", b"a preview")
        worker.say("preview", **{"pass": 3, "file": "preview.raw", "bytes": 9})
        await asyncio.sleep(0.3)
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await is_running(rig, job.id)
        for _ in range(5):
            rig.dispatcher.ask_preview(job.id, 0)
        await rig.ended(job.id)
        assert [event.data for event in rig.events(job.id, "preview")] == [{"frame": 0, "pass": 3}]
        assert (rig.data.frame(job.id, 0) / "preview.raw").read_bytes() == b"a preview"
        assert executor.workers[0].told == ["preview"]  # before the stop, which may tell it to yield

    play(tmp_path, script, act)
