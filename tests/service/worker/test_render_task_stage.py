"""A worker keeps the stage of its frames, unless that has become large."""

from __future__ import annotations

import pytest
from tests.service.executor.scenes import ROOM

from primray.diagnostics import Diagnostics
from primray.report.report import Costs
from primray.settings import RenderSettings
from primray_service.limits import GiB
from primray_service.worker import render_task
from primray_service.worker.render_task import StageOfFrames

BASE = 300 * 2**20  # of libraries


def opened(stages: StageOfFrames, file: str, max_memory_bytes: int) -> bool:
    entered: list[str] = []
    costs = Costs()
    costs.on_stage = entered.append
    settings = RenderSettings(resolution=(8, 8), spp=8, max_memory_bytes=max_memory_bytes)
    stages.prepare(file, settings, costs, Diagnostics(), more_follow=True)
    return "open" in entered


@pytest.mark.parametrize(("grown", "stays"), [(2**20, True), (GiB // 8 + 1, False)])
def test_what_counts_is_what_came_with_the_stage(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, grown: int, stays: bool
) -> None:
    """Not the libraries, which take more than an eighth of 1 GiB."""
    file = tmp_path_factory.mktemp("job") / "room.usda"
    file.write_text(ROOM)
    monkeypatch.setattr(render_task, "resident_bytes", lambda: BASE)
    stages = StageOfFrames()
    monkeypatch.setattr(render_task, "resident_bytes", lambda: BASE + grown)
    assert opened(stages, str(file), GiB)
    assert opened(stages, str(file), GiB) is not stays
