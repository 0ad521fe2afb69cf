"""A pilot that ends before an error can be estimated goes on until it can: a slow machine or a heavy stage is no Ctrl-C."""

from __future__ import annotations

from pathlib import Path

import primray
from primray import usd
from primray.diagnostics import Diagnostics
from primray.render.prepare import prepare
from primray.report.report import Costs
from primray.sampling.prediction import run_pilot
from primray.settings import RenderSettings

STAGE = """#usda 1.0
def Sphere "ball"
{
}
def DomeLight "sky"
{
}
"""


def test_an_estimate_after_a_pilot_of_no_time(tmp_path: Path) -> None:
    stage = tmp_path / "ball.usda"
    stage.write_text(STAGE)
    found = primray.estimate(stage, [0.5], resolution=(640, 360), pilot_seconds=1e-6)
    assert found.samples >= 1
    assert found.seconds > 0
    assert [prediction.target for prediction in found.predictions] == [0.5]


def test_a_pilot_that_is_stopped_is_still_a_stop(tmp_path: Path) -> None:
    stage = tmp_path / "ball.usda"
    stage.write_text(STAGE)
    settings = RenderSettings(resolution=(64, 36))
    opened = usd.open_stage(stage, Diagnostics(), settings.composition)
    prepared = prepare(opened, Diagnostics(), settings, Costs(), Diagnostics())
    assert run_pilot(prepared.scene, prepared.settings, 1.0, lambda done, samples, rays: False) is None
