"""Pausing, resuming and retrying a frame, by scripted workers: who is told what, and what is kept."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest
from tests.service.dispatcher.parts.pieces import Pieces
from tests.service.dispatcher.play import QUICKLY_S, play
from tests.service.dispatcher.rig import NO_QUOTAS, Rig
from tests.service.dispatcher.scripted import ScriptedExecutor, Worker

from primray_service.jobs import FrameState, JobState

pytestmark = pytest.mark.usefixtures("no_wait_ends")


async def until_told_or_done(worker: Worker) -> None:
    """Renders until it is told to yield; from a checkpoint, to the end."""
    worker.sampling()
    if worker.went_on_from:
        worker.done()
        return
    assert await worker.hears("stop", "yield") == "yield"
    worker.checkpoint()
    worker.say("yielded", number=worker.number)


async def is_in(rig: Rig, job_id: str, state: JobState) -> None:
    await rig.until(lambda: rig.job(job_id).state is state)


def test_a_paused_job_keeps_its_checkpoint_and_takes_no_worker(tmp_path: Path) -> None:
    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), time_codes=(1.0, 2.0))
        await is_in(rig, job.id, JobState.RUNNING)
        asked = time.monotonic()
        assert rig.store.request_pause(job.id, time.time()).state is JobState.PAUSING
        rig.dispatcher.wake()
        await is_in(rig, job.id, JobState.PAUSED)
        assert time.monotonic() - asked < QUICKLY_S
        assert not executor.running
        assert (rig.frame(job.id).state, rig.frame(job.id).checkpoint) == (FrameState.QUEUED, 1)
        other = rig.submit(rig.scene(), settings={"seed": 1})  # the slot is free for others
        await is_in(rig, other.id, JobState.RUNNING)
        rig.store.request_cancel(other.id, time.time())
        rig.dispatcher.wake()
        await rig.ended(other.id)
        assert rig.job(job.id).state is JobState.PAUSED
        rig.store.request_resume(job.id, time.time())
        rig.dispatcher.wake()
        await rig.until(lambda: rig.frame(job.id).state is FrameState.SUCCEEDED)

    async def script(worker: Worker) -> None:
        if worker.command["settings"]["seed"] == 1:
            worker.sampling()
            await worker.hears("stop")
            worker.done("interrupted")
        else:
            await until_told_or_done(worker)

    executor = play(tmp_path, script, act)
    assert [worker.went_on_from for worker in executor.workers][:3] == [b"", b"", b"1"]


def test_a_worker_that_still_loads_is_ended_at_once(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.say("phase", phase="opening")
        await asyncio.sleep(60)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.until(lambda: len(executor.workers) == 1)
        rig.store.request_pause(job.id, time.time())
        rig.dispatcher.wake()
        asked = time.monotonic()
        await is_in(rig, job.id, JobState.PAUSED)
        assert time.monotonic() - asked < QUICKLY_S
        assert (rig.frame(job.id).crashes, rig.frame(job.id).kills) == (0, 0)
        rig.store.request_cancel(job.id, time.time())
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.CANCELED

    play(tmp_path, script, act)


def test_canceling_while_it_pauses_keeps_the_picture(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        await worker.hears("yield")
        await worker.hears("stop")
        worker.done("interrupted")

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.until(lambda: rig.frame(job.id).checkpoint == 1)
        rig.store.request_pause(job.id, time.time())
        rig.dispatcher.wake()
        await rig.until(lambda: executor.workers[0].told == ["yield"])
        rig.store.request_cancel(job.id, time.time())
        rig.dispatcher.wake()
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.CANCELED
        assert len(rig.outputs(job.id)) == 3

    play(tmp_path, script, act)


def test_a_restart_of_the_server_leaves_it_paused(tmp_path: Path) -> None:
    jobs: list[str] = []

    async def pauses(rig: Rig, executor: ScriptedExecutor) -> None:
        jobs.append(rig.submit(rig.scene()).id)
        await is_in(rig, jobs[0], JobState.RUNNING)
        rig.store.request_pause(jobs[0], time.time())
        rig.dispatcher.wake()
        await is_in(rig, jobs[0], JobState.PAUSED)

    async def resumes(rig: Rig, executor: ScriptedExecutor) -> None:
        await asyncio.sleep(0.7)  # longer than a dispatcher waits between two looks
        assert rig.job(jobs[0]).state is JobState.PAUSED
        assert executor.workers == []
        rig.store.request_resume(jobs[0], time.time())
        rig.dispatcher.wake()
        [ended] = await rig.ended(jobs[0])
        assert ended.state is JobState.SUCCEEDED

    play(tmp_path, until_told_or_done, pauses)
    executor = play(tmp_path, until_told_or_done, resumes)
    assert [worker.went_on_from for worker in executor.workers] == [b"1"]


def test_a_frame_in_parts_pauses_with_what_its_parts_have(tmp_path: Path) -> None:
    async def hook(worker: Worker, where: str) -> None:
        await asyncio.sleep(0.05)

    pieces = Pieces(hook)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings={"stop": {"max_samples": 64}}, parallel="auto")
        await rig.until(lambda: len(executor.workers) >= 2)
        rig.store.request_pause(job.id, time.time())
        rig.dispatcher.wake()
        await is_in(rig, job.id, JobState.PAUSED)
        assert not executor.running
        rig.store.request_resume(job.id, time.time())
        rig.dispatcher.wake()
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error

    play(tmp_path, pieces.script, act, slots=2)
    assert pieces.shown == [(0, 64)]


@pytest.mark.parametrize("fails", [False, True])
def test_one_frame_of_a_sequence_is_rendered_again(tmp_path: Path, fails: bool) -> None:
    made: dict[float, int] = {}

    async def script(worker: Worker) -> None:
        code = float(worker.command["settings"]["time_code"])
        made[code] = made.get(code, 0) + 1
        worker.sampling()
        if fails and code == 2.0 and made[code] == 1:
            worker.fails("render-failed")
            return
        worker.checkpoint()
        worker.done(pixels=f"{made[code]}" * 64)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), time_codes=(1.0, 2.0, 3.0))
        [first] = await rig.ended(job.id)
        assert first.state is (JobState.FAILED if fails else JobState.SUCCEEDED)
        before = {output.name: output.sha256 for output in rig.outputs(job.id)}
        rig.store.retry_frame(job.id, 1, 1, time.time(), NO_QUOTAS)
        rig.dispatcher.wake()
        await rig.until(lambda: rig.job(job.id).finished_at not in (None, first.finished_at))
        [again] = await rig.ended(job.id)
        assert (again.state, again.attempt, again.error) == (JobState.SUCCEEDED, 1, None)
        after = {output.name: output.sha256 for output in rig.outputs(job.id)}
        assert len(after) == 9
        assert {name for name in after if before.get(name) != after[name]} == {
            "beauty.0002.exr",
            "beauty.0002.png",
            "report.0002.json",
        }
        assert again.progress["frames"] == {"total": 3, "queued": 0, "running": 0, "succeeded": 3, "failed": 0, "canceled": 0}
        assert again.progress["fraction"] == 1.0
        assert [event.data["state"] for event in rig.events(job.id, "end")] == [first.state.value, "succeeded"]
        assert rig.frame(job.id, 1).cpu_s == 1.0  # both runs are counted
        assert rig.store.usage("studio", time.time()).cpu_s_total == 2.0

    executor = play(tmp_path, script, act)
    assert made == {1.0: 1, 2.0: 2, 3.0: 1}
    assert executor.workers[-1].went_on_from == b""
    assert executor.workers[-1].chunk.group != executor.workers[0].chunk.group
