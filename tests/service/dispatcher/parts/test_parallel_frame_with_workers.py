"""Real workers: a frame that is rendered in parts has the bits of one render, and the report of one."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.dispatcher.rig import MakeExecutor, Rig, dispatching

from primray import RenderSettings, render
from primray import read_image as read_picture
from primray.denoising.denoiser import has_denoiser
from primray.images.image import Image, pixels_sha256
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


@cache
def of_the_library(**ends: Any) -> Image:
    return render(str(SCENE), RenderSettings(resolution=SIZE, seed=5, adaptive=False, **ends))


@cache
def target_between_anchors() -> float:
    """Return an error that the frame reaches between two of the numbers of samples at which it is measured in any case."""
    for target in np.geomspace(0.002, 0.0001, 12).tolist():
        [samples] = set(of_the_library(target_error=target).report["samples_per_pixel"])
        if samples & (samples - 1):
            return float(target)
    pytest.fail("every target is reached at an anchor")


def served(root: Path, slots: int, act: Callable[[Rig], Awaitable[None]]) -> None:
    async def run() -> None:
        async with dispatching(root, local(slots)) as rig:
            await act(rig)

    asyncio.run(run())


def report_of(rig: Rig, job: Job) -> Any:
    return json.loads((rig.data.outputs(job.id) / "report.json").read_bytes())


ASKED = {"resolution": list(SIZE), "seed": 5}


def test_the_picture_has_the_bits_of_one_render(tmp_path: Path) -> None:
    """An odd number of samples too."""

    async def act(rig: Rig) -> None:
        scene = rig.scene(SCENE.read_bytes())
        [job] = await rig.ended(
            rig.submit(scene, settings={**ASKED, "stop": {"max_samples": 65}}, parallel="auto").id, timeout_s=240
        )
        assert pixels(job) == pixels_sha256(of_the_library(spp=65).pixels)
        assert job.effective_settings is not None
        assert job.effective_settings["settings"]["sample_range"] is None
        assert (rig.data.frame(job.id, 0) / "preview.raw").is_file()

    served(tmp_path, 2, act)


@pytest.mark.skipif(not has_denoiser(), reason="primray[denoise] is not installed")
def test_what_stands_beside_the_picture_is_that_of_one_render(tmp_path: Path) -> None:
    one = of_the_library(spp=33, denoise=True, aovs=("crypto_object", "depth"))

    async def act(rig: Rig) -> None:
        asked = {**ASKED, "stop": {"max_samples": 33}, "denoise": True, "aovs": ["crypto_object", "depth"]}
        [job] = await rig.ended(rig.submit(rig.scene(SCENE.read_bytes()), settings=asked, parallel=2).id, timeout_s=240)
        assert pixels(job) == pixels_sha256(one.pixels)
        name = next(row.name for row in rig.outputs(job.id) if row.name.endswith(".exr"))
        found = read_picture(rig.data.outputs(job.id) / name)
        assert one.denoised is not None
        assert found.denoised is not None
        assert np.array_equal(found.denoised.pixels, one.denoised.pixels)
        for name, aov in one.aovs.items():
            assert found.aovs[name].values.tobytes() == aov.values.tobytes()

    served(tmp_path, 2, act)


@pytest.mark.parametrize("parallel", [1, 2, 3])
def test_by_an_error_it_has_the_bits_of_one_render_with_that_error(tmp_path: Path, parallel: int) -> None:
    """And its measurements, in whatever moments parts came."""
    target = target_between_anchors()
    one = of_the_library(target_error=target)
    [samples] = set(one.report["samples_per_pixel"])

    async def act(rig: Rig) -> None:
        scene = rig.scene(SCENE.read_bytes())
        asked = {**ASKED, "stop": {"target_error": target}}
        [job] = await rig.ended(rig.submit(scene, settings=asked, parallel=parallel).id, timeout_s=240)
        assert job.result is not None, job.error
        report = report_of(rig, job)
        assert report["samples_per_pixel"] == [samples, samples]
        assert pixels(job) == pixels_sha256(one.pixels)
        assert job.result["stop"] == {"reason": "target-error", "target_met": True}
        assert rig.frame(job.id).merged == (samples if parallel > 1 else 0)
        if parallel > 1:  # a frame in one place has a first look too
            assert [row["samples"] for row in report["convergence"]] == [row["samples"] for row in one.report["convergence"]]
        assert report["error"] == one.report["error"]

    served(tmp_path, 3, act)
