"""Checks of scenes by scripted workers: what they find, and how their ends are told."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path

import pytest
from tests.service.dispatcher.play import play
from tests.service.dispatcher.rig import Rig
from tests.service.dispatcher.scripted import Dies, ScriptedExecutor, Worker

from primray_service.jobs import JobState, Scene, SceneState


async def checked(rig: Rig, scene: Scene) -> Scene:
    found: list[Scene] = []

    def is_checked() -> bool:
        now = rig.store.scene(scene.tenant, scene.id)
        assert now is not None
        found.append(now)
        return now.state is not SceneState.CHECKING

    await rig.until(is_checked)
    return found[-1]


def test_a_scene_becomes_ready_and_its_job_runs(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        if worker.chunk.kind == "check":
            assert worker.command["kind"] == "usda"
            worker.say("warning", code="unused", prim="/a", detail="Nothing refers to it.")
            worker.say("facts", cameras=["/camera"])
        else:
            worker.sampling()
            worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        scene = rig.scene(ready=False)
        job = rig.submit(scene)
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED
        now = await checked(rig, scene)
        assert (now.state, now.facts["cameras"]) == (SceneState.READY, ["/camera"])
        assert [warning["code"] for warning in now.warnings] == ["unused"]

    executor = play(tmp_path, script, act)
    assert [worker.chunk.kind for worker in executor.workers] == ["check", "render"]


def test_checks_run_beside_renders(tmp_path: Path) -> None:
    """A render that takes long does not keep anybody's upload waiting."""
    render_may_end = asyncio.Event()

    async def script(worker: Worker) -> None:
        if worker.chunk.kind == "check":
            worker.say("facts")
        else:
            worker.sampling()
            await render_may_end.wait()
            worker.done()

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        job = rig.submit(rig.scene())
        await rig.until(lambda: rig.job(job.id).state is JobState.RUNNING)
        now = await checked(rig, rig.scene(b"#usda 1.0\n# another", ready=False))
        assert now.state is SceneState.READY
        render_may_end.set()
        await rig.ended(job.id)

    play(tmp_path, script, act)


@pytest.mark.parametrize(
    ("ends", "slug", "tries"),
    [
        (Dies("signal", signal.SIGSEGV), "renderer-crashed", 2),
        (Dies("exited", exit_code=1), "renderer-crashed", 2),
        (Dies("signal", signal.SIGKILL), "renderer-crashed", 5),
        (Dies("time-limit"), "time-limit", 1),
        (Dies("memory-limit"), "memory-limit", 1),
    ],
    ids=lambda value: str(value) if isinstance(value, str | int) else "",
)
def test_a_check_that_dies_rejects_the_scene_and_its_jobs(tmp_path: Path, ends: Dies, slug: str, tries: int) -> None:
    async def script(worker: Worker) -> None:
        raise Dies(ends.ended[0], ends.ended[2], ends.ended[1])

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        scene = rig.scene(ready=False)
        [job] = await rig.ended(rig.submit(scene).id)
        now = await checked(rig, scene)
        assert now.state is SceneState.REJECTED
        assert now.problem is not None
        assert now.problem["type"] == f"/problems/{slug}"
        assert job.state is JobState.FAILED
        assert job.error is not None
        assert job.error["type"] == f"/problems/{slug}"

    assert len(play(tmp_path, script, act).workers) == tries


def test_a_scene_is_rejected_with_what_the_check_found(tmp_path: Path) -> None:
    async def script(worker: Worker) -> None:
        problem = {"type": "/problems/asset-path-outside-job", "detail": "No.", "layer": "root.usda", "asset_path": "../x"}
        worker.say("failed", problem=problem)

    async def act(rig: Rig, executor: ScriptedExecutor) -> None:
        now = await checked(rig, rig.scene(ready=False))
        assert now.problem is not None
        assert (now.problem["type"], now.problem["asset_path"]) == ("/problems/asset-path-outside-job", "../x")
        assert now.problem["status"] == 422

    play(tmp_path, script, act)
