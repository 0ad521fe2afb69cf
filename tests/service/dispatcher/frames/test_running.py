"""A frame's run, by scripted workers: what is adopted, what is told, and what becomes of it when its worker dies."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from tests.service.dispatcher.play import play
from tests.service.dispatcher.rig import NO_QUOTAS, Rig
from tests.service.dispatcher.scripted import Dies, ScriptedExecutor, Worker, killed_outside, segfault

from primray_service.jobs import FrameState, JobState

FILES = (("beauty", "exr"), ("beauty", "png"), ("report", "json"))


async def renders(worker: Worker) -> None:
    worker.sampling()
    worker.progress(0.5)
    worker.checkpoint()
    worker.done()


def test_a_frame_is_rendered_and_its_files_are_adopted(tmp_path: Path) -> None:
    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), settings={"stop": {"max_samples": 64}})
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED
        assert [output.name for output in rig.outputs(job.id)] == ["beauty.exr", "beauty.png", "report.json"]
        frame = rig.frame(job.id)
        assert (frame.state, frame.checkpoint, frame.cpu_s) == (FrameState.SUCCEEDED, 1, 0.5)
        assert (rig.data.job(job.id) / frame.checkpoint_file).read_bytes() == b"1"
        assert ended.result is not None
        assert ended.result["stop"] == {"reason": "samples", "target_met": None}
        assert ended.result["pixels_sha256"] == [{"frame": 0, "sha256": "0" * 64}]
        assert ended.result["outputs"] == 3
        assert ended.progress["fraction"] == 1.0
        assert ended.usage == {"cpu_s": 0.5, "peak_rss_bytes": 2**20}
        assert "the worker's log" in (rig.data.frame(job.id, 0) / "log.txt").read_text()
        states = [event.data["state"] for event in rig.events(job.id, "state")]
        assert states == ["queued", "preparing", "running", "succeeded"]

    executor = play(tmp_path, renders, act)
    command = executor.workers[0].command
    assert command["settings"]["spp"] == 64
    assert command["settings"]["threads"] == 2
    assert (command["checkpoint"], command["number"]) == (None, 0)


def test_only_the_last_checkpoint_is_kept(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        for _ in range(5):
            worker.checkpoint()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.ended(job.id)
        names = sorted(path.name for path in rig.data.frame(job.id, 0).iterdir())
        assert names == [Path(rig.frame(job.id).checkpoint_file).name, "log.txt"]
        assert rig.frame(job.id).checkpoint == 5

    play(tmp_path, script, act)


def test_two_crashes_without_a_checkpoint_fail_the_frame(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        raise segfault()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(rig.submit(rig.scene()).id)
        assert job.state is JobState.FAILED
        assert job.error is not None
        assert job.error["type"] == "/problems/renderer-crashed"
        assert job.error["signal"] == "SIGSEGV"
        assert job.error["attempt"] == 1

    assert len(play(tmp_path, script, act).workers) == 2


def test_a_checkpoint_between_crashes_forgives_the_first(tmp_path: Path) -> None:
    """Dies after 1, 2, 3 checkpoints; a server that counted all deaths would give up at the second."""

    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        await asyncio.sleep(0.05)
        if worker.number < 4:
            raise segfault()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(rig.submit(rig.scene()).id)
        assert job.state is JobState.SUCCEEDED
        assert rig.frame(job.id).checkpoint == 4

    executor = play(tmp_path, script, act)
    assert [worker.went_on_from for worker in executor.workers] == [b"", b"1", b"12", b"123"]
    assert [worker.command["number"] for worker in executor.workers] == [0, 1, 2, 3]


def test_kills_from_outside_are_no_fault_of_the_scene(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        if len(executors[0].workers) < 5:
            raise killed_outside()
        worker.done()

    executors: list[ScriptedExecutor] = []

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        executors.append(executor)
        [job] = await rig.ended(rig.submit(rig.scene()).id)
        assert job.state is JobState.SUCCEEDED
        assert rig.dispatcher.metrics.restarts == {"kill": 4}

    play(tmp_path, script, act)


def test_so_many_kills_end_it_all_the_same(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        raise Dies("lost")

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(rig.submit(rig.scene()).id)
        assert job.error is not None
        assert job.error["type"] == "/problems/render-failed"

    assert len(play(tmp_path, script, act, kills=3).workers) == 3


@pytest.mark.parametrize("reason", ["memory-limit", "time-limit", "storage-limit"])
def test_a_limit_ends_it_at_once(tmp_path: Path, reason: str) -> None:
    async def script(worker: Worker) -> None:
        raise Dies(reason)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(rig.submit(rig.scene()).id)
        assert job.error is not None
        assert job.error["type"] == f"/problems/{reason}"
        assert job.error["limit"] > 0
        if reason == "memory-limit":
            assert job.error["limit"] == executor.capacity().memory_bytes  # which may be less than what is allowed

    assert len(play(tmp_path, script, act).workers) == 1


def test_a_worker_that_leaves_without_a_word_has_crashed(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(rig.submit(rig.scene()).id)
        assert job.error is not None
        assert job.error["exit_code"] == 0

    assert len(play(tmp_path, script, act).workers) == 2


def test_an_unusable_checkpoint_costs_time_only(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        if worker.went_on_from:
            worker.fails("checkpoint-unusable")
            return
        worker.sampling()
        if worker.number == 0:
            worker.checkpoint()
            await asyncio.sleep(0.05)
            raise segfault()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(rig.submit(rig.scene()).id)
        assert job.state is JobState.SUCCEEDED

    executor = play(tmp_path, script, act)
    assert [(w.command["checkpoint"], w.command["number"]) for w in executor.workers] == [
        (None, 0),
        ("checkpoint.prc", 1),
        (None, 1),
    ]


def test_a_failed_frame_does_not_stop_the_others(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        if worker.command["settings"]["time_code"] == 2.0:
            worker.fails("scene-rejected", "Nothing to see at 2.")
            return
        told = {"code": "light-input", "prim": "/a", "severity": "warning", "kind": "ignored"}
        for attribute in ("inputs:shaping:focus", "inputs:shadow:color"):
            worker.say("warning", **told, attribute=attribute, detail="It is not shown.")
        worker.checkpoint()
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene(), time_codes=(1.0, 2.0, 3.0))
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.FAILED
        assert ended.error is not None
        assert (ended.error["type"], ended.error["frame"]) == ("/problems/scene-rejected", 1)
        assert ended.progress["frames"] == {
            "total": 3,
            "queued": 0,
            "running": 0,
            "succeeded": 2,
            "failed": 1,
            "canceled": 0,
        }
        made = {f"{name}.000{i}.{suffix}" for i in (1, 3) for name, suffix in FILES}
        assert {output.name for output in rig.outputs(job.id)} == made
        told = [(warning["prim"], warning["kind"], warning["attribute"]) for warning in ended.warnings]
        assert told == [("/a", "ignored", "inputs:shaping:focus"), ("/a", "ignored", "inputs:shadow:color")], "over all frames"
        assert len(rig.events(job.id, "warning")) == 2

    play(tmp_path, script, act)


def test_progress_never_falls(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.progress(0.3 if worker.number else 0.8)
        if not worker.number:
            worker.checkpoint()
        await asyncio.sleep(0.7)
        if len(executors[0].workers) == 1:
            raise killed_outside()
        worker.done()

    executors: list[ScriptedExecutor] = []

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        executors.append(executor)
        job = rig.submit(rig.scene())
        await rig.ended(job.id)
        told = [event.data["fraction"] for event in rig.events(job.id, "progress")]
        assert max(told) == 0.8
        assert told == sorted(told)

    play(tmp_path, script, act)


def test_an_end_above_the_target_is_a_warning(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.done("samples", met=False)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        [job] = await rig.ended(rig.submit(rig.scene(), settings={"stop": {"target_error": 0.01, "max_samples": 64}}).id)
        assert job.state is JobState.SUCCEEDED
        assert [warning["code"] for warning in job.warnings] == ["target-not-met"]
        assert job.result is not None
        assert job.result["error"]["target"] == 0.01
        assert job.result["stop"]["target_met"] is False

    play(tmp_path, script, act)


def test_a_continued_job_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.checkpoint()
        worker.done(pixels=f"{worker.number}" * 64)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.ended(job.id)
        rig.store.continue_job(job.id, {"max_samples": 128}, 1e9, NO_QUOTAS)
        rig.dispatcher.wake()
        await rig.until(lambda: rig.frame(job.id).checkpoint == 2 and rig.job(job.id).state is JobState.SUCCEEDED)
        assert {output.name for output in rig.outputs(job.id)} == {"beauty-2.exr", "beauty-2.png", "report-2.json"}
        await rig.until(lambda: len(list(rig.data.outputs(job.id).iterdir())) == 3)

    executor = play(tmp_path, script, act)
    assert executor.workers[1].went_on_from == b"1"
    assert executor.workers[1].command["settings"]["spp"] == 128


def test_the_preview_of_a_frame_that_ends_at_once_is_kept(tmp_path: Path) -> None:
    """Nobody had looked at the worker's messages before it was gone."""

    async def script(worker: Worker) -> None:
        worker.sampling()
        worker.write("preview.raw", b"a preview")
        worker.say("preview", **{"pass": 1, "file": "preview.raw", "bytes": 9})
        worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.ended(job.id)
        assert (rig.data.frame(job.id, 0) / "preview.raw").read_bytes() == b"a preview"

    play(tmp_path, script, act)
