"""Real workers: a frame that is rendered in parts has the bits of one render, and the report of one."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

from tests.service.dispatcher.rig import MakeExecutor, Rig, dispatching

from primray import RenderSettings, render
from primray.images.image import pixels_sha256
from primray_service.executor.local import LocalExecutor
from primray_service.files import DataDirectory
from primray_service.jobs import Job, JobState
from primray_service.limits import Limits

SCENE = Path(__file__).parents[4] / "scenes/features/glass/scene.usda"
SIZE = (64, 48)


def local(slots: int) -> MakeExecutor:
    def make(data: DataDirectory, limits: Limits) -> LocalExecutor:
        return LocalExecutor(data, limits, slots=slots, cores=2)

    return make


def pixels(job: Job) -> str:
    assert job.state is JobState.SUCCEEDED, job.error
    assert job.result is not None
    return str(job.result["pixels_sha256"][0]["sha256"])


def of_the_library(samples: int) -> str:
    settings = RenderSettings(resolution=SIZE, spp=samples, seed=5, adaptive=False)
    return pixels_sha256(render(str(SCENE), settings).pixels)


def test_the_picture_has_the_bits_of_one_render(tmp_path: Path) -> None:
    """By samples, of an odd number too, and by an error."""

    async def act(rig: Rig) -> None:
        scene = rig.scene(SCENE.read_bytes())
        asked = {"resolution": list(SIZE), "seed": 5}
        by_samples = rig.submit(scene, settings={**asked, "stop": {"max_samples": 65}}, parallel="auto")
        by_error = rig.submit(scene, settings={**asked, "stop": {"target_error": 0.02}}, parallel=2)
        first, second = await rig.ended(by_samples.id, by_error.id, timeout_s=240)
        assert pixels(first) == of_the_library(65)
        assert rig.frame(second.id).merged > 0
        report = json.loads((rig.data.outputs(second.id) / "report.json").read_bytes())
        assert second.result is not None
        assert second.result["stop"] == {"reason": "target-error", "target_met": True}
        [samples] = set(report["samples_per_pixel"])
        assert pixels(second) == of_the_library(samples)
        assert second.effective_settings is not None
        assert second.effective_settings["settings"]["sample_range"] is None
        assert (rig.data.frame(second.id, 0) / "preview.raw").is_file()

    async def run() -> None:
        async with dispatching(tmp_path, local(2)) as rig:
            await act(rig)

    asyncio.run(run())
