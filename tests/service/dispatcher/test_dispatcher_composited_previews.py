"""Previews of jobs whose pictures have something behind them: a colour, an image of the package, the shadow of a ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from tests.service.dispatcher.rig import Rig
from tests.service.dispatcher.test_dispatcher_products import STAGE, folder_of, play, values_of

from primray_service.jobs import FrameState, JobState
from primray_service.pictures.process import picture
from primray_service.pictures.request import PictureRequest
from primray_service.worker.preview import read_preview

BLUE = {"background": "#3060a0", "products": ["beauty"]}
FEW, MANY = {"stop": {"max_samples": 4}}, {"stop": {"max_samples": 200_000}}


def shown(rig: Rig, job_id: str) -> npt.NDArray[Any]:
    return picture(read_preview(rig.data.frame(job_id, 0) / "preview.raw"), PictureRequest())[0].astype(int)


@pytest.mark.parametrize("more", [{}, {"ground": "shadow"}, {"denoise": False}], ids=["colour", "shadow", "parallel"])
def test_the_preview_of_a_job_that_ended_is_its_png(tmp_path: Path, more: dict[str, Any]) -> None:
    async def act(rig: Rig) -> None:
        parallel = {"parallel": "auto"} if "denoise" in more else {}
        made = rig.submit(rig.scene((STAGE % "x").encode()), settings={**BLUE, **FEW, **more}, **parallel)
        [job] = await rig.ended(made.id, timeout_s=60)
        assert job.state is JobState.SUCCEEDED, job.error
        kept, seen = values_of(folder_of(rig, job.id) / "beauty.png") * 255, shown(rig, job.id)
        assert np.all(kept[..., 3] == 255)
        assert np.abs(kept[..., :3] - seen).max() <= 2
        assert tuple(seen[0, 0]) == (48, 96, 160)

    play(tmp_path, act)


def test_a_picture_that_refines_shows_the_background(tmp_path: Path) -> None:
    async def act(rig: Rig) -> None:
        job = rig.submit(rig.scene((STAGE % "x").encode()), settings={**BLUE, **MANY})
        file = rig.data.frame(job.id, 0) / "preview.raw"
        await rig.until(file.is_file, 60)
        assert rig.frame(job.id).state is FrameState.RUNNING
        assert tuple(shown(rig, job.id)[0, 0]) == (48, 96, 160)

    play(tmp_path, act)


def test_parts_that_are_put_together_show_the_background(tmp_path: Path) -> None:
    """The image of the package is found by the process that merges, as by those that render."""
    from primray import RenderSettings, render
    from primray.checkpoints.checkpointing import Checkpointing
    from primray_service.worker import merge_task

    stage, behind = tmp_path / "stage.usda", tmp_path / "behind.png"
    stage.write_text(STAGE % "x")
    plate = oiio.ImageBuf(oiio.ImageSpec(48, 32, 3, oiio.UINT8))
    oiio.ImageBufAlgo.fill(plate, (48 / 255, 96 / 255, 160 / 255))
    assert plate.write(str(behind))
    settings = RenderSettings(sample_range=(0, 4), adaptive=False)
    render(str(stage), settings, checkpointing=Checkpointing(tmp_path / "part.prc"), progress=False)
    command = {"parts": ["part.prc"], "number": 0, "target": None, "metric": "relmse", "file": "stage.usda"}
    channel = Channel()
    merge_task.merge_parts({**command, "background": "behind.png"}, tmp_path, tmp_path, channel)  # type: ignore[arg-type]
    seen = picture(read_preview(tmp_path / "preview.raw"), PictureRequest())[0]
    assert np.abs(seen[0, 0].astype(int) - (48, 96, 160)).max() <= 1


class Channel:
    """What a merge reports goes nowhere."""

    def send(self, *of: Any, **what: Any) -> None: ...

    def done(self, **what: Any) -> None: ...
