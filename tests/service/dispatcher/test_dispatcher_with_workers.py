"""Real workers under the dispatcher: pictures have the bits of the command line's, whatever happens to their workers."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.dispatcher.rig import NO_QUOTAS, MakeExecutor, Rig, dispatching
from tests.service.faults import descendants

from primray import RenderSettings, render
from primray.denoising.denoiser import has_denoiser
from primray.images.exr_parts import read_aovs
from primray.images.image import pixels_sha256
from primray.images.reading import read_image as read_picture
from primray.images.reading import read_measured
from primray_service.executor.base import Chunk, Handle, OnMessage
from primray_service.executor.local import LocalExecutor
from primray_service.executor.local_worker import Run
from primray_service.files import DataDirectory
from primray_service.jobs import Job, JobState
from primray_service.limits import Limits

SCENE = Path(__file__).parents[3] / "scenes/features/glass/scene.usda"
SIZE = (64, 48)


def local(slots: int = 1) -> MakeExecutor:
    def make(data: DataDirectory, limits: Limits) -> LocalExecutor:
        return LocalExecutor(data, limits, slots=slots, cores=2)

    return make


def asked(samples: int, seed: int = 5) -> dict[str, object]:
    return {"resolution": list(SIZE), "seed": seed, "stop": {"max_samples": samples}}


@pytest.fixture(scope="module")
def expected() -> str:
    """The bits of 2048 samples, by the library."""
    image = render(str(SCENE), RenderSettings(resolution=SIZE, spp=2048, seed=5))
    return pixels_sha256(image.pixels)


def pixels(job: Job) -> str:
    assert job.state is JobState.SUCCEEDED, job.error
    assert job.result is not None
    return str(job.result["pixels_sha256"][0]["sha256"])


def test_whatever_happens_to_workers_the_bits_are_the_same(tmp_path: Path, expected: str) -> None:
    """Killed from outside after a checkpoint; told to give way to a job of higher priority; let alone."""

    async def act(rig: Rig) -> None:
        scene = rig.scene(SCENE.read_bytes())
        killed = rig.submit(scene, settings=asked(2048))
        await rig.until(lambda: rig.frame(killed.id).checkpoint > 0)
        for pid in descendants(os.getpid()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        [job] = await rig.ended(killed.id, timeout_s=180)
        assert rig.dispatcher.metrics.restarts["kill"] == 1
        assert pixels(job) == expected

        low = rig.submit(scene, settings=asked(2048), priority=10)
        await rig.until(lambda: rig.frame(low.id).phase == "sampling")
        high = rig.submit(scene, settings=asked(16, seed=6), priority=90)
        first, second = await rig.ended(high.id, low.id, timeout_s=180)
        assert first.state is JobState.SUCCEEDED
        assert pixels(second) == expected

        alone = rig.submit(scene, settings=asked(2048))
        [job] = await rig.ended(alone.id, timeout_s=180)
        assert pixels(job) == expected
        assert job.usage["cpu_s"] > 0.1

    async def run() -> None:
        async with dispatching(tmp_path, local(), checkpoint_every_s=0.2) as rig:
            await act(rig)

    asyncio.run(run())


def test_aovs_are_parts_of_the_exr(tmp_path: Path) -> None:
    async def act(rig: Rig) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked(2) | {"aovs": ["depth", "prim"]})
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error
        name = next(row.name for row in rig.outputs(job.id) if row.name.endswith(".exr"))
        file = rig.data.outputs(job.id) / name
        image = render(str(SCENE), RenderSettings(resolution=SIZE, spp=2, seed=5, aovs=("depth", "prim")))
        assert np.array_equal(read_measured(file).pixels, image.pixels[..., :3])
        parts = read_aovs(file)
        assert list(parts) == ["depth", "prim"]
        for name, aov in parts.items():
            assert np.array_equal(aov.values, image.aovs[name].values)
        assert parts["prim"].ids == image.aovs["prim"].ids
        assert ended.result is not None

    async def run() -> None:
        async with dispatching(tmp_path, local()) as rig:
            await act(rig)

    asyncio.run(run())


@pytest.mark.parametrize("parallel", [None, "auto"])
def test_a_frame_stops_at_the_error_of_a_mix_of_lights(tmp_path: Path, parallel: str | None) -> None:
    """As one render does, also where its parts are rendered in several places and judged when they are merged."""
    rules: dict[str, Any] = {"seed": 5, "aovs": ["lights"], "stop_at": "mix", "mixes": ["key=6"], "adaptive": False}

    async def act(rig: Rig) -> None:
        asked = {**rules, "resolution": list(SIZE), "stop": {"target_error": 0.004}}
        if parallel is not None:
            del asked["adaptive"]
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=asked, parallel=parallel)
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error
        name = next(row.name for row in rig.outputs(job.id) if row.name.endswith(".exr"))
        image = render(str(SCENE), RenderSettings(resolution=SIZE, target_error=0.004, **rules))
        assert np.array_equal(read_picture(rig.data.outputs(job.id) / name).pixels, image.pixels)
        assert ended.result is not None
        assert ended.result["stop"] == {"reason": "target-error", "target_met": True}
        error = image.report["error"]["mix"]["relmse"]
        assert ended.result["error"] == {"metric": "relmse", **error, "target": 0.004} | {"kind": ended.result["error"]["kind"]}

    async def run() -> None:
        async with dispatching(tmp_path, local()) as rig:
            await act(rig)

    asyncio.run(run())


@pytest.mark.skipif(not has_denoiser(), reason="primray[denoise] is not installed")
def test_denoised_pictures_stand_beside_their_record(tmp_path: Path) -> None:
    stop = {"target_error": 0.01, "max_samples": 64}
    settings = {"resolution": list(SIZE), "seed": 5, "stop": stop, "stop_at": "denoised"}

    async def act(rig: Rig) -> None:
        job = rig.submit(rig.scene(SCENE.read_bytes()), settings=settings)
        [ended] = await rig.ended(job.id)
        assert ended.state is JobState.SUCCEEDED, ended.error
        name = next(row.name for row in rig.outputs(job.id) if row.name.endswith(".exr"))
        found = read_picture(rig.data.outputs(job.id) / name)
        image = render(str(SCENE), RenderSettings(resolution=SIZE, spp=64, seed=5, target_error=0.01, stop_at="denoised"))
        assert image.denoised is not None
        assert found.denoised is not None
        assert np.array_equal(found.pixels, image.pixels)
        assert np.array_equal(found.denoised.pixels, image.denoised.pixels)
        assert ended.result is not None
        assert ended.result["stop"] == {"reason": "target-error", "target_met": True}
        assert ended.result["denoised"]["estimate"] <= ended.result["denoised"]["target"] == 0.01

    async def run() -> None:
        async with dispatching(tmp_path, local()) as rig:
            await act(rig)

    asyncio.run(run())


def test_cancel_is_quick_and_keeps_the_picture_and_continue_goes_on(tmp_path: Path, expected: str) -> None:
    async def act(rig: Rig) -> None:
        scene = rig.scene(SCENE.read_bytes())
        job = rig.submit(scene, settings=asked(100_000))
        await rig.until(lambda: float(rig.job(job.id).progress.get("samples_done") or 0) > 8)
        began = time.monotonic()
        rig.store.request_cancel(job.id, time.time())
        rig.dispatcher.wake()
        [ended] = await rig.ended(job.id)
        assert time.monotonic() - began < 15  # under a second on a machine that does nothing else
        assert ended.state is JobState.CANCELED
        assert len(rig.outputs(job.id)) == 3
        assert ended.result is not None
        assert ended.result["stop"]["reason"] == "interrupted"
        assert rig.frame(job.id).checkpoint > 0

        rig.store.continue_job(job.id, {"max_samples": 2048}, time.time(), NO_QUOTAS)
        rig.dispatcher.wake()
        [again] = await rig.ended(job.id, timeout_s=180)
        assert again.attempt == 2
        if float(ended.progress["samples_done"]) < 2048:
            assert pixels(again) == expected

    async def run() -> None:
        async with dispatching(tmp_path, local()) as rig:
            await act(rig)

    asyncio.run(run())


MOVING = b"""#usda 1.0
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "ball" {
    double3 xformOp:translate.timeSamples = { 1: (-1, 0, 0), 10: (1, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DistantLight "sun" {
}
"""


class Counting(LocalExecutor):
    """Notes which process got which chunk."""

    def submit(self, chunk: Chunk, on_message: OnMessage) -> Handle:
        handle = super().submit(chunk, on_message)
        assert isinstance(handle, Run)
        self.pids = [*getattr(self, "pids", []), (chunk.scene, handle.pid)]
        return handle


def test_frames_of_a_job_share_workers_and_have_the_bits_of_one_alone(tmp_path: Path) -> None:
    """Two jobs at once, each of ten frames, in two slots; one loses its worker on the way."""
    codes = [float(code) for code in range(1, 11)]
    file = tmp_path / "scene.usda"
    file.write_bytes(MOVING)
    alone = {
        code: pixels_sha256(render(str(file), RenderSettings(resolution=(32, 32), spp=2, seed=5, time_code=code)).pixels)
        for code in codes
    }
    assert len(set(alone.values())) == 10

    def make(data: DataDirectory, limits: Limits) -> LocalExecutor:
        return Counting(data, limits, slots=2, cores=2)

    async def act(rig: Rig) -> None:
        scene = rig.scene(MOVING)
        asks = {"resolution": [32, 32], "seed": 5, "stop": {"max_samples": 2}}
        jobs = [rig.submit(scene, settings=asks, time_codes=codes).id for _ in range(2)]
        await rig.until(lambda: rig.store.frame_counts(jobs[0])["succeeded"] > 2, 120)
        assert isinstance(rig.executor, Counting)
        with contextlib.suppress(ProcessLookupError):
            os.kill(rig.executor.pids[-1][1], signal.SIGKILL)
        for job in await rig.ended(*jobs, timeout_s=240):
            assert job.state is JobState.SUCCEEDED, job.error
            assert job.result is not None
            made = {codes[row["frame"]]: row["sha256"] for row in job.result["pixels_sha256"]}
            assert made == alone
            assert len(rig.outputs(job.id)) == 30
        scenes: dict[int, set[str]] = {}
        for of_chunk, pid in rig.executor.pids:
            scenes.setdefault(pid, set()).add(of_chunk)
        assert all(len(found) == 1 for found in scenes.values())
        assert len(scenes) <= 10  # of twenty frames: under load a worker may be waited for in vain

    async def run() -> None:
        async with dispatching(tmp_path, make) as rig:
            await act(rig)

    asyncio.run(run())
