"""Jobs of several products, with real workers: each product's file by its name, with the pixels that the library makes."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from tests.service.dispatcher.rig import Rig, dispatching
from tests.service.faults import descendants

import primray
from primray_service.executor.local import LocalExecutor
from primray_service.files import DataDirectory
from primray_service.jobs import JobState
from primray_service.limits import Limits

STAGE = """#usda 1.0
(
    upAxis = "Y"
    renderSettingsPrimPath = "/Render/S"
    startTimeCode = 1
    endTimeCode = 2
)
def Camera "camera" {
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "side" {
    double3 xformOp:translate = (1, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "ball" {
    double radius = 1
    double3 xformOp:translate.timeSamples = { 1: (-1, 0, 0), 2: (1, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DistantLight "sun" {
    float inputs:intensity = 20000
}
def Scope "Render" {
    def RenderSettings "S" {
        rel camera = </camera>
        rel products = [</Render/beauty>, </Render/depth>, </Render/side>]
        int2 resolution = (48, 32)
    }
    def RenderProduct "beauty" {
        token productName = "../out/shot.exr"
        rel orderedVars = [</Render/color>]
    }
    def RenderProduct "depth" {
        token productName = "data/shot.exr"
        rel orderedVars = [</Render/z>]
    }
    def RenderProduct "side" {
        token productName = "side view.%s.exr"
        rel camera = </side>
        rel orderedVars = [</Render/color>]
    }
    def RenderVar "color" {
        token dataType = "color3f"
        string sourceName = "Ci"
    }
    def RenderVar "z" {
        token dataType = "float"
        string sourceName = "depth"
    }
}
"""
SMALL = {"stop": {"max_samples": 4}, "products": ["*"]}


def local(data: DataDirectory, limits: Limits) -> LocalExecutor:
    return LocalExecutor(data, limits, slots=1, cores=2)


def play(root: Path, act: Callable[[Rig], Awaitable[None]], **limits: Any) -> None:
    async def run() -> None:
        async with dispatching(root, local, limits=replace(Limits(free_disk_bytes=0), **limits)) as rig:
            await act(rig)

    asyncio.run(run())


def values_of(file: Path) -> npt.NDArray[Any]:
    """Return the values of the file's first part, whatever its channels are."""
    found = oiio.ImageBuf(str(file)).get_pixels(oiio.FLOAT)
    assert found is not None
    return found


def folder_of(rig: Rig, job_id: str) -> Path:
    return rig.data.outputs(job_id)


def test_all_products_of_each_frame_have_files_of_their_own_names(tmp_path: Path) -> None:
    async def act(rig: Rig) -> None:
        scene = rig.scene((STAGE % "####").encode())
        made = rig.submit(scene, settings=SMALL, time_codes=(1.0, 2.0))
        [job] = await rig.ended(made.id, timeout_s=120)
        assert job.state is JobState.SUCCEEDED, job.error
        names = {row.name: row.frame for row in rig.outputs(job.id)}
        assert names == {
            f"{stem}.000{code}.{suffix}": code - 1
            for code in (1, 2)
            for stem, suffix in (("out_shot", "exr"), ("data_shot", "exr"), ("side_view", "exr"), ("report", "json"))
        }
        stage = tmp_path / "stage.usda"
        stage.write_text(STAGE % "####")
        expected = primray.render_products(str(stage), spp=4, time_code=2, filter="box", progress=False)
        for (product, image), name in zip(expected, ("out_shot", "data_shot", "side_view"), strict=True):
            ours, theirs = folder_of(rig, job.id) / f"{name}.0002.exr", product.save(image, tmp_path / "by_library" / name)
            assert np.array_equal(values_of(ours), values_of(theirs)), name
        # Two renders are made of the three products, and the report has both.
        report = json.loads((folder_of(rig, job.id) / "report.0002.json").read_text())
        assert [row["products"] for row in report["renders"]] == [["/Render/beauty", "/Render/depth"], ["/Render/side"]]
        assert job.result is not None
        assert job.result["samples"] == sum(row["samples"] for row in report["renders"]) * 2

    play(tmp_path, act)


def test_a_worker_that_dies_costs_no_product_that_was_finished(tmp_path: Path) -> None:
    """The checkpoint of the first render is there when the process is killed in the second; the pixels are those of no kill."""

    async def act(rig: Rig) -> None:
        scene = rig.scene((STAGE % "x").encode())
        asked = {"stop": {"max_samples": 4096}, "products": ["/Render/side", "/Render/beauty"]}
        job = rig.submit(scene, settings=asked)
        await rig.until(lambda: rig.frame(job.id).progress.get("fraction", 0) > 0.52, 180)
        assert rig.frame(job.id).checkpoint > 0
        for pid in descendants(os.getpid()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        alone = rig.submit(scene, settings=asked)
        found = await rig.ended(job.id, alone.id, timeout_s=180)
        assert [each.state for each in found] == [JobState.SUCCEEDED] * 2, found[0].error
        assert rig.dispatcher.metrics.restarts["kill"] == 1
        for name in ("shot.exr", "side_view.x.exr"):
            one, other = (values_of(folder_of(rig, each.id) / name) for each in (job, alone))
            assert np.array_equal(one, other), name

    play(tmp_path, act, checkpoint_every_s=0.2)


def test_products_are_named_as_the_command_line_names_them(tmp_path: Path) -> None:
    async def act(rig: Rig) -> None:
        scene = rig.scene((STAGE % "x").encode())
        asked = [["side"], ["/Render/side"], ["side", "/Render/beauty"], ["sde"]]
        made = [rig.submit(scene, settings={**SMALL, "products": products}) for products in asked]
        by_name, by_path, several, wrong = await rig.ended(*(job.id for job in made), timeout_s=120)
        one, other = (values_of(folder_of(rig, job.id) / "beauty.exr") for job in (by_name, by_path))
        assert np.array_equal(one, other)
        assert {row.name for row in rig.outputs(several.id)} == {"shot.exr", "side_view.x.exr", "report.json"}
        assert wrong.error is not None
        assert wrong.error["detail"].startswith("There is no product sde; the products of the render settings: /Render/beauty")

    play(tmp_path, act)


@pytest.mark.parametrize(
    ("name", "asked", "words"),
    [("####", ["*"], "in settings.frames"), ("x", ["/Render/none", "/Render/side"], "There is no product /Render/none")],
)
def test_products_that_cannot_be_made_are_refused(tmp_path: Path, name: str, asked: list[str], words: str) -> None:
    async def act(rig: Rig) -> None:
        made = rig.submit(rig.scene((STAGE % name).encode()), settings={**SMALL, "products": asked})
        [job] = await rig.ended(made.id, timeout_s=60)
        assert job.error is not None
        assert job.error["type"] == "/problems/settings-rejected"
        assert words in job.error["detail"]

    play(tmp_path, act)


def test_view_exposure_halves_and_compression_are_the_job_s(tmp_path: Path) -> None:
    async def act(rig: Rig) -> None:
        scene = rig.scene((STAGE % "x").encode())
        files = {"view": "Un-tone-mapped", "exposure": 1.0, "half": ["rgba"], "compression": "dwaa:45"}
        plain = rig.submit(scene, settings={"stop": {"max_samples": 4}})
        chosen = rig.submit(scene, settings={"stop": {"max_samples": 4}, "background": "#ff0000", **files})
        found = await rig.ended(plain.id, chosen.id, timeout_s=60)
        assert [job.state for job in found] == [JobState.SUCCEEDED] * 2, found[1].error

        spec = oiio.ImageBuf(str(folder_of(rig, chosen.id) / "beauty.exr")).spec()
        assert spec.get_string_attribute("compression").startswith("dwaa")
        assert str(oiio.ImageBuf(str(folder_of(rig, chosen.id) / "beauty.exr")).nativespec().channelformat(0)) == "half"
        png, before = (values_of(folder_of(rig, job.id) / "beauty.png") for job in (chosen, plain))
        assert tuple(png[0, 0, :3]) == (1, 0, 0)
        assert png[..., 1].sum() > 1.2 * before[..., 1].sum() > 0

    play(tmp_path, act)
