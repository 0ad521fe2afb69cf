"""The time left that a render tells at half-time, against the time that it then took.

CPU seconds stand for time, so that other work on the machine does not count; a shared machine is no part of the forecast.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from primray import usd
from primray.diagnostics import Diagnostics
from primray.render import prepare
from primray.report.report import Costs
from primray.sampling import sampling as sampling_module
from primray.sampling.error import Estimate
from primray.sampling.prediction import Forecaster
from primray.sampling.sampling import Sampling
from primray.settings import RenderSettings

SCENES = Path(__file__).parents[3] / "scenes" / "features"
THREADS = 2


def told_at_half_time(monkeypatch: pytest.MonkeyPatch, scene: str, **values: Any) -> tuple[float, Estimate]:
    """Seconds that were left then, and the forecast of them."""
    clock = SimpleNamespace(perf_counter=lambda: time.process_time() / THREADS)
    monkeypatch.setattr(sampling_module, "time", clock)
    settings = RenderSettings(resolution=(160, 120), threads=THREADS, **values)
    stage = usd.open_stage(str(SCENES / scene / "scene.usda"), Diagnostics(), settings.composition)
    prepared = prepare(stage, Diagnostics(), settings, Costs(), Diagnostics())
    Sampling.begin(prepared.scene, replace(prepared.settings, spp=2)).run()  # what is paid once in a process
    sampling = Sampling.begin(prepared.scene, prepared.settings)
    sampling.schedule = replace(sampling.schedule, resumable=True, first_look=True)
    forecaster, seen = Forecaster(sampling), []

    def look(fraction: float, samples: int, rays: int) -> None:
        left = forecaster.look().left_s
        if left is not None:
            seen.append((sampling.now_s, left))

    sampling.run(look)
    at, left = max(found for found in seen if found[0] <= sampling.seconds / 2)
    return sampling.seconds - at, left


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "values"),
    [
        ("glass", {"target_error": 2e-5}),
        ("clearcoat", {"target_error": 1e-5}),
        ("dome-texture", {"target_error": 4e-6}),
        ("glass", {"spp": 1500}),
        ("dome-texture", {"spp": 1500}),
        ("clearcoat", {"time_limit_s": 2.0}),
    ],
)
def test_at_half_time_it_is_right_within_30_percent(
    monkeypatch: pytest.MonkeyPatch, scene: str, values: dict[str, Any]
) -> None:
    left_s, told = told_at_half_time(monkeypatch, scene, **values)
    print(f"{scene} {values}: {told.value / left_s:.2f} of {left_s:.2f} s, {told.low / left_s:.2f} to {told.high / left_s:.2f}")
    assert told.value == pytest.approx(left_s, rel=0.3)
    if "time_limit_s" not in values:
        assert told.low < left_s < told.high
