"""Frames of parts have the bits of one render, whoever renders which part, in whatever order they come, whatever is lost."""

from __future__ import annotations

import time
from concurrent.futures import Future
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.images.checkpoints.resuming import run, save, scene, sha256

from primray.distributed.executor import PartLost
from primray.distributed.gather import gather
from primray.distributed.planner import PartCosts
from primray.errors import PrimrayError, RenderCancelled, SettingsError
from primray.images.image import Image
from primray.report.report import Costs
from primray.settings import RenderSettings

TARGET = 0.0021


class FakeExecutor:
    """Renders parts here, in any order; of those that were given some are lost. A turn is a call of `slots`."""

    def __init__(self, seed: int = 0, slots: int = 3, loses: float = 0.0) -> None:
        self.rng = np.random.default_rng(seed)
        self.most = slots
        self.loses = loses
        self.open: list[tuple[RenderSettings, Path, Future[None]]] = []
        self.parts: list[tuple[int, int]] = []
        self.stages: list[str] = []
        self.ended = 0

    def begin(self, stage: str) -> None:
        self.stages.append(stage)

    def slots(self) -> int:
        while self.open and self.rng.random() < 0.7:
            self._do(*self.open.pop(int(self.rng.integers(len(self.open)))))
        return self.most

    def _do(self, settings: RenderSettings, file: Path, future: Future[None]) -> None:
        if future.cancelled():
            return
        if self.rng.random() < self.loses:
            future.set_exception(PartLost("it was unplugged"))
            return
        assert settings.sample_range is not None
        save(run(sample_range=settings.sample_range), file)
        self.parts.append(settings.sample_range)
        future.set_result(None)

    def submit(self, settings: RenderSettings, file: Path) -> Future[None]:
        future: Future[None] = Future()
        self.open.append((settings, file, future))
        return future

    def end(self) -> None:
        self.ended += 1


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.distributed.gather.LOOK_EVERY_S", 0.001)


def gathered(executor: FakeExecutor, progress: Any = None, **values: Any) -> Image:
    asked = RenderSettings(**{"resolution": scene().resolution, "filter_width": 1.0, **values})
    image = gather(executor, "shot.usda", asked, Costs(), progress).image
    assert (executor.stages, executor.ended) == (["shot.usda"], 1)
    return image


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("loses", [0.0, 0.3])
def test_samples(seed: int, loses: float) -> None:
    executor = FakeExecutor(seed, slots=1 + seed, loses=loses)
    image, whole = gathered(executor, spp=70), run(spp=70)
    assert image.report["pixels_sha256"] == sha256(whole)
    assert image.report["error"] == whole.rows[-1].error.as_json()
    assert image.report["sample_ranges"] == [[0, 70]]
    assert image.report["stop"] == {"reason": "samples", "target_met": None}
    assert image.report["settings"]["spp"] == 70
    assert loses or image.report["distribution"]["lost"] == 0
    assert sum(b - a for a, b in executor.parts) == 70
    assert image.report["diagnostics"] == []


@pytest.mark.parametrize("seed", range(6))
def test_it_stops_by_its_error_where_one_render_does(seed: int) -> None:
    """However many slots work ahead, and whatever they lose."""
    whole = run(target_error=TARGET, adaptive=False)
    assert whole.done % 8 != 0, "between two anchors"
    executor = FakeExecutor(seed, slots=(1, 2, 5)[seed % 3], loses=0.2 * (seed // 3))
    image = gathered(executor, target_error=TARGET)
    assert image.report["samples_per_pixel"] == [whole.done, whole.done]
    assert image.report["pixels_sha256"] == sha256(whole)
    assert image.report["error"] == whole.rows[-1].error.as_json()
    assert image.report["stop"] == {"reason": "target-error", "target_met": True}
    assert [row["samples"] for row in image.report["convergence"]] == [row.samples for row in whole.rows]
    assert image.report["settings"]["target_error"] == TARGET


def test_a_target_that_the_samples_do_not_reach() -> None:
    image = gathered(FakeExecutor(), spp=20, target_error=1e-9)
    assert image.report["pixels_sha256"] == sha256(run(spp=20))
    assert image.report["stop"] == {"reason": "samples", "target_met": False}


def test_it_ends_early_where_no_part_would_be_finished_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PartCosts, "with_part", lambda costs, samples, sampling_s, overhead_s: PartCosts(1e3, 0.0))
    began = time.monotonic()
    image = gathered(FakeExecutor(slots=1), spp=2000, time_limit_s=300.0)
    assert image.report["stop"]["reason"] == "time-limit"
    assert time.monotonic() - began < 100.0


def test_parts_get_shorter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.distributed.planner.LEAST_S", 0.0)  # the scene's samples take milliseconds
    # Costs as measured depend on what else the machine does.
    monkeypatch.setattr(PartCosts, "with_part", lambda costs, samples, sampling_s, overhead_s: PartCosts(1e-3, 0.0))
    executor = FakeExecutor(slots=2)
    gathered(executor, spp=2000)
    sizes = [b - a for a, b in sorted(executor.parts)]
    assert sizes[0] > sizes[-1]
    assert max(sizes) <= 500


def test_what_is_always_lost() -> None:
    with pytest.raises(PrimrayError, match="in a row were lost; the last: it was unplugged") as raised:
        gathered(FakeExecutor(loses=1.0), spp=20)
    assert raised.value.code == "parts-lost"


def test_a_file_that_is_cut_off_is_lost() -> None:
    class Cutting(FakeExecutor):
        cut = 0

        def _do(self, settings: RenderSettings, file: Path, future: Future[None]) -> None:
            super()._do(settings, file, future)
            if file.exists() and self.cut < 2:
                self.cut += 1
                file.write_bytes(file.read_bytes()[:-9])

    image = gathered(Cutting(), spp=40)
    assert image.report["pixels_sha256"] == sha256(run(spp=40))
    assert image.report["distribution"]["lost"] == 2


def test_errors_of_the_frame_end_it() -> None:
    class Failing(FakeExecutor):
        def _do(self, settings: RenderSettings, file: Path, future: Future[None]) -> None:
            future.set_exception(SettingsError("no such camera", code="camera"))

    executor = Failing()
    with pytest.raises(SettingsError, match="no such camera"):
        gathered(executor, spp=20)
    assert executor.ended == 1


def test_nowhere_to_render(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("primray.distributed.gather.NOWHERE_S", 0.05)
    with pytest.raises(PrimrayError, match="no worker was available") as raised:
        gathered(FakeExecutor(slots=0), spp=20)
    assert raised.value.code == "parts-nowhere"


def test_it_is_stopped_with_the_samples_so_far() -> None:
    """Those that came, though there may be gaps."""
    executor = FakeExecutor(slots=4)
    image = gathered(executor, lambda *now: len(executor.parts) < 3, spp=4000)
    ranges = image.report["sample_ranges"]
    assert image.report["interrupted"]
    assert sum(b - a for a, b in ranges) == image.report["samples_per_pixel"][0]
    if len(ranges) == 1 and ranges[0][0] == 0:
        assert image.report["pixels_sha256"] == sha256(run(spp=ranges[0][1]))
    else:
        assert [row["code"] for row in image.report["diagnostics"]] == ["samples-missing"]


def test_it_is_stopped_before_there_is_anything() -> None:
    with pytest.raises(RenderCancelled):
        gathered(FakeExecutor(), lambda *now: False, spp=20)


def test_a_time_limit() -> None:
    image = gathered(FakeExecutor(), time_limit_s=0.2)
    assert image.report["stop"]["reason"] == "time-limit"
    assert image.report["settings"]["time_limit_s"] == 0.2 or image.report["settings"]["sample_range"]
    assert image.report["samples"] > 0


def test_progress_never_goes_back() -> None:
    told: list[tuple[float, int, int]] = []
    gathered(FakeExecutor(loses=0.2), lambda *now: told.append(now), target_error=TARGET)
    assert all(a <= b for a, b in pairwise(told))
    assert told[-1][1] > 0


@pytest.mark.parametrize(
    ("values", "where"),
    [({"spp": 3}, "spp"), ({"sample_range": (0, 8)}, "sample_range"), ({"adaptive": True, "spp": 64}, "adaptive")],
)
def test_what_parts_cannot_do(values: dict[str, Any], where: str) -> None:
    executor = FakeExecutor()
    with pytest.raises(SettingsError) as raised:
        gathered(executor, **values)
    assert (raised.value.code, raised.value.where) == ("parts-setting", where)
    assert executor.stages == []


def test_each_code_is_documented() -> None:
    page = (Path(__file__).parents[3] / "docs/service/scaling.md").read_text()
    assert [code for code in ("parts-setting", "parts-lost", "parts-nowhere") if f"| `{code}` |" not in page] == []
