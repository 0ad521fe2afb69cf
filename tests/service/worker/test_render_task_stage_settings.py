"""What a stage asks of its render is under the limits of jobs, like what jobs ask for."""

from __future__ import annotations

from typing import Any

import pytest

from primray.diagnostics import Diagnostics
from primray.render import Prepared
from primray.settings import RenderSettings
from primray.settings.stage_settings import Asked, StageSettings
from primray_service.worker.render_task import within_limits

LIMITS = {"samples": 1024, "seconds": 60.0}


def prepared(**asked: Any) -> Prepared:
    rows = tuple(Asked(name, value, "/Render/s", f"primray:{name}") for name, value in asked.items())
    nothing: Any = None
    settings, taken = StageSettings(rows).applied_to(RenderSettings())
    return Prepared(nothing, settings, {}, nothing, nothing, {}, asked=StageSettings(taken))


@pytest.mark.parametrize(
    ("asked", "followed", "told"),
    [
        ({"spp": 64, "max_depth": 5000}, (64, None), 0),
        ({"spp": 4096}, (1024, None), 1),
        ({"spp": 4096, "time_limit_s": 900.0}, (1024, 60.0), 2),
    ],
)
def test_a_stage_gets_no_more_than_a_job_could(asked: dict[str, Any], followed: tuple[Any, Any], told: int) -> None:
    diagnostics = Diagnostics()
    found = within_limits(prepared(**asked), LIMITS, diagnostics).settings
    assert (found.spp, found.time_limit_s) == followed
    assert [d.code for d in diagnostics] == ["render-settings-input"] * told
    assert within_limits(prepared(**asked), {}, diagnostics).settings.spp == asked["spp"]
