"""Jobs on a Ray cluster of two nodes: the bits of one machine, whatever happens to workers, tasks, nodes and the head.

The tests share one server's dispatcher, and run in this order: the last one ends the cluster.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import os
import signal
import time
import zipfile
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.service.api_calls import checked, finished, submit, wait_until
from tests.service.conftest import StartServer
from tests.service.dispatcher.rig import Rig, dispatching
from tests.service.executor.ray.cluster import RunningCluster
from tests.service.executor.ray.test_link_without_a_cluster import refused
from tests.service.executor.scenes import ROOM

from primray import RenderSettings, render
from primray.images.image import pixels_sha256
from primray_service.executor.local import LocalExecutor
from primray_service.executor.ray import protocol
from primray_service.executor.ray.executor import RayExecutor
from primray_service.files import DataDirectory
from primray_service.jobs import Job, JobState
from primray_service.limits import GiB, Limits
from primray_service.problems import Problem
from primray_service.worker.preview import read_preview

SCENE = Path(__file__).parents[4] / "scenes/features/glass/scene.usda"
SIZE = (48, 36)
SAMPLES, FOREVER = 4096, 2**20  # some seconds, so that there are checkpoints to kill it after
LIMITS = Limits(free_disk_bytes=0, memory_bytes=GiB, checkpoint_every_s=0.3, load_cpu_s=20.0)
WAIT_S = 180.0  # of a machine that others use too
# What Python runs first on the node whose walls do not hold: one attempt to get out succeeds there.
BROKEN_WALLS = """
import sys
import primray_service.sandbox
test = sys.modules["primray_service.sandbox.self_test"]
run = test._run
test._run = lambda *given: ({**run(*given)[0], "open a file": "allowed"}, None)
"""

ROOT_LAYER = '#usda 1.0\n(\n    defaultPrim = "World"\n    subLayers = [@layers/room.usda@]\n)\n'

Act = Callable[[Callable[[Rig], Coroutine[Any, Any, None]]], None]


@pytest.fixture(scope="module")
def expected() -> str:
    """The bits of all samples, by the library."""
    return pixels_sha256(render(str(SCENE), RenderSettings(resolution=SIZE, spp=SAMPLES, seed=5)).pixels)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("server")


@pytest.fixture(scope="module")
def act(cluster: RunningCluster, root: Path) -> Iterator[Act]:
    """Do something with the one dispatcher, whose executor gives out one chunk at a time."""

    def on_ray(data: DataDirectory, limits: Limits) -> RayExecutor:
        return RayExecutor(data, limits, address=cluster.address, slots=1)

    with asyncio.Runner() as runner:
        server = dispatching(root, on_ray, limits=LIMITS)
        rig = runner.run(server.__aenter__())
        rig.look_every_s = 0.1  # workers are to have the cores
        yield lambda what: runner.run(what(rig))
        with contextlib.suppress(asyncio.CancelledError):
            runner.run(server.__aexit__(None, None, None))


def asked(samples: int | None = SAMPLES, seed: int = 5, **stop: object) -> dict[str, object]:
    return {"resolution": list(SIZE), "seed": seed, "stop": {"max_samples": samples, **stop}}


def pixels(job: Job) -> str:
    assert job.state is JobState.SUCCEEDED, job.error
    assert job.result is not None
    return str(job.result["pixels_sha256"][0]["sha256"])


def received(rig: Rig) -> list[int]:
    return [node["received"]["objects"] for node in rig.executor.health()["nodes"]]


def test_the_bits_are_those_of_one_machine(act: Act, expected: str) -> None:
    async def what(rig: Rig) -> None:
        capacity = rig.executor.capacity()
        assert (capacity.slots, capacity.threads, capacity.nodes) == (1, 1, 2)
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked())
        [job] = await rig.ended(job.id, timeout_s=WAIT_S)
        assert pixels(job) == expected
        assert {output.name for output in rig.outputs(job.id)} == {"beauty.exr", "beauty.png", "report.json"}
        assert job.usage["cpu_s"] > 0.01
        assert job.progress["fraction"] == 1
        assert rig.events(job.id, "progress")

    act(what)


def test_a_scene_goes_to_a_node_once(act: Act) -> None:
    async def what(rig: Rig) -> None:
        scene, before = SCENE.read_bytes() + b"\n# no other test's\n", received(rig)
        for seed in range(2):
            job = rig.submit(rig.scene(scene), settings=asked(16, seed))
            [job] = await rig.ended(job.id, timeout_s=WAIT_S)
            assert job.state is JobState.SUCCEEDED, job.error
        assert max(now - then for now, then in zip(received(rig), before, strict=True)) == 1
        assert rig.executor.health()["ok"]

    act(what)


def test_previews_and_cancel(act: Act) -> None:
    """It is told how it is doing, is seen as it grows, and keeps its picture."""

    async def what(rig: Rig) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked(FOREVER))
        await rig.until(lambda: rig.frame(job.id).phase == "sampling", WAIT_S)
        shown = rig.data.frame(job.id, 0) / "preview.raw"
        await rig.until(shown.exists, WAIT_S)
        first = read_preview(shown).passes
        rig.dispatcher.ask_preview(job.id, 0)
        await rig.until(lambda: read_preview(shown).passes > first, WAIT_S)
        await rig.until(lambda: bool(rig.events(job.id, "progress")), WAIT_S)
        rig.store.request_cancel(job.id, time.time())
        rig.dispatcher.wake()
        [job] = await rig.ended(job.id, timeout_s=WAIT_S)
        assert job.state is JobState.CANCELED
        assert len(rig.outputs(job.id)) == 3

    act(what)


def test_time_limits(act: Act) -> None:
    async def what(rig: Rig) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked(None, max_seconds=0.5))
        [job] = await rig.ended(job.id, timeout_s=WAIT_S)
        assert job.result is not None
        assert job.result["stop"]["reason"] == "time-limit"

    act(what)


def test_whatever_is_killed_the_bits_are_the_same(act: Act, cluster: RunningCluster, expected: str) -> None:
    """First a worker, then a task with all that it has started; the frame goes on from its checkpoint."""

    async def what(rig: Rig) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked())
        for pids in (cluster.workers, cluster.tasks):
            before = rig.frame(job.id).checkpoint
            await rig.until(lambda before=before: rig.frame(job.id).checkpoint > before, WAIT_S)  # type: ignore[misc]
            for pid in pids():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        [job] = await rig.ended(job.id, timeout_s=WAIT_S)
        assert pixels(job) == expected
        assert rig.dispatcher.metrics.restarts["kill"] >= 1

    act(what)


def test_a_job_gives_way_and_goes_on(act: Act, expected: str) -> None:
    async def what(rig: Rig) -> None:
        scene = rig.scene(SCENE.read_bytes())
        low = rig.submit(scene, settings=asked(), priority=10)
        await rig.until(lambda: rig.frame(low.id).phase == "sampling", WAIT_S)
        high = rig.submit(scene, settings=asked(16, seed=6), priority=90)
        first, second = await rig.ended(high.id, low.id, timeout_s=WAIT_S)
        assert first.state is JobState.SUCCEEDED
        assert pixels(second) == expected

    act(what)


def test_a_package_over_http(cluster: RunningCluster, start_server: StartServer) -> None:
    """A server of its own: the scene is checked on the cluster, and its package comes there as one."""
    with io.BytesIO() as made:
        with zipfile.ZipFile(made, "w") as package:
            package.writestr("shot.usda", ROOT_LAYER)
            package.writestr("layers/room.usda", ROOM)
        body = made.getvalue()
    server = start_server(executor="ray", ray_address=cluster.address, slots=1, limits={"memory_bytes": GiB})
    client = server.client()
    scene = client.post("/v1/scenes", content=body).json()["id"]
    wait_until(lambda: checked(client, scene), WAIT_S)
    job = finished(client, submit(client, scene)["id"], WAIT_S)
    assert job["state"] == "succeeded", job["error"]
    ready = client.get("/readyz").json()["checks"]["executor"]
    assert (ready["ok"], ready["slots"], len(ready["nodes"])) == (True, 1, 2)
    assert 1 <= sum(node["received"]["objects"] for node in ready["nodes"]) <= 2
    assert server.failures() == []


def test_tokens(cluster: RunningCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_AUTH_TOKEN", "of-others-" + "0" * 54)
    assert refused(tmp_path, cluster.address).extra["code"] == protocol.WRONG_TOKEN
    monkeypatch.delenv("RAY_AUTH_TOKEN")
    monkeypatch.setenv("HOME", str(tmp_path))
    problem = refused(tmp_path, cluster.address)
    assert problem.extra["code"] == protocol.WRONG_TOKEN
    assert "there is no token" in problem.detail


def test_a_node_without_walls_takes_no_work(act: Act, cluster: RunningCluster, tmp_path: Path) -> None:
    """Whoever has no other node is told so at once, by its code."""
    (tmp_path / "sitecustomize.py").write_text(BROKEN_WALLS)
    path = os.pathsep.join([str(tmp_path), cluster.environment["PYTHONPATH"]])
    cluster.ask(do="add", number=2, labels={"pool": "open"}, environment={"PYTHONPATH": path})

    async def what(rig: Rig) -> None:
        alone = RayExecutor(rig.data, LIMITS, address=cluster.address, labels={"pool": "open"})
        with pytest.raises(Problem, match="the sandbox does not work there: a worker can open a file") as raised:
            await alone.start()
        assert raised.value.extra["code"] == protocol.NO_NODE
        await alone.close()
        await rig.until(lambda: any("sandbox" in node["why"] for node in rig.executor.health()["nodes"]), WAIT_S)
        assert rig.executor.health()["ok"]
        assert rig.executor.capacity().nodes == 2

    try:
        act(what)
    finally:
        cluster.ask(do="remove", number=2)


def test_without_the_head_jobs_wait_and_the_database_knows_them(
    act: Act, cluster: RunningCluster, root: Path, expected: str
) -> None:
    waited: list[str] = []

    async def what(rig: Rig) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked())
        await rig.until(lambda: rig.frame(job.id).checkpoint > 0, WAIT_S)
        cluster.ask(do="kill-head")
        await rig.until(lambda: not rig.executor.health()["ok"], WAIT_S)
        assert "jobs stay queued" in rig.executor.health()["why"]
        assert rig.executor.capacity().slots == 0
        waiting = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked(16))
        await rig.until(lambda: rig.frame(job.id).state.value == "queued", WAIT_S)
        await asyncio.sleep(1.0)
        assert rig.job(waiting.id).state is JobState.QUEUED
        assert rig.frame(job.id).checkpoint > 0
        waited.extend([job.id, waiting.id])

    act(what)
    found = asyncio.run(_ended_on_one_machine(root, waited))
    assert pixels(found[0]) == expected
    assert all(job.state is JobState.SUCCEEDED for job in found)


async def _ended_on_one_machine(root: Path, job_ids: list[str]) -> list[Job]:
    """By another dispatcher over the same database, once the first has lost its lease."""

    def here(data: DataDirectory, limits: Limits) -> LocalExecutor:
        return LocalExecutor(data, limits, slots=1, cores=1)

    async with dispatching(root, here, limits=LIMITS) as rig:
        return await rig.ended(*job_ids, timeout_s=WAIT_S)
