"""What ends a render, what it says of that, and that the decisions leave the picture unbiased."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.statistics.errors.calibration import case

import primray
from primray import RenderSettings
from primray.cli import run
from primray.errors import SettingsError
from primray.settings import Metric

SCENE = str(Path(__file__).resolve().parents[3] / "scenes" / "features" / "texture" / "scene.usda")
SMALL: dict[str, Any] = {"resolution": (48, 36), "max_depth": 3}


def report(**settings: Any) -> dict[str, Any]:
    return dict(primray.render(SCENE, RenderSettings(**SMALL, **settings)).report)


def test_samples_end_a_render_by_default() -> None:
    r = report(spp=24)
    assert r["stop"] == {"reason": "samples", "target_met": None}
    assert r["samples_per_pixel"] == [24, 24]
    assert [row["samples"] for row in r["convergence"]] == [16, 24]
    assert all(a["seconds"] <= b["seconds"] for a, b in zip(r["convergence"], r["convergence"][1:], strict=False))


def test_pixels_that_a_time_limit_leaves_without_samples_are_reported(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    image = primray.render(SCENE, RenderSettings(resolution=(1024, 1024), time_limit_s=0.001), progress=False)
    missing = (~image.pixels.any(axis=-1)).mean()  # the stage's dome fills the picture where it is sampled
    assert missing > 0.1
    row = next(row for row in image.report["diagnostics"] if row["code"] == "unsampled-pixels")
    assert float(row["message"].split()[0]) == pytest.approx(100 * missing, rel=0.01)
    assert image.report["error"]["relmse"] is None
    arguments = ["--res", "1024", "1024", "--time-limit", "0.001", "-o", str(tmp_path / "a.exr")]
    assert run(["render", SCENE, *arguments]) == 0
    assert "no error estimate: some pixels have no samples; stopped by time-limit" in capsys.readouterr().out


def test_one_sample_a_pixel_has_no_error(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run(["render", SCENE, "--res", "48", "36", "--spp", "1", "-o", str(tmp_path / "a.exr")]) == 0
    assert "no error estimate: only one sample a pixel; stopped by samples" in capsys.readouterr().out


@pytest.mark.parametrize("adaptive", [False, True])
def test_a_target_ends_a_render(adaptive: bool) -> None:
    r = report(target_error=1e-4, adaptive=adaptive)
    assert r["stop"] == {"reason": "target-error", "target_met": True}
    low, high = r["error"]["relmse"]["ci95"]
    assert low < r["error"]["relmse"]["estimate"] <= 1e-4 < 1.4 * high
    uniform = r["samples_per_pixel"][0] == r["samples_per_pixel"][1]
    assert uniform != adaptive


def test_the_cap_comes_first() -> None:
    r = report(target_error=1e-9, spp=40)
    assert r["stop"] == {"reason": "samples", "target_met": False}
    assert r["samples"] <= 40 * 48 * 36


def test_the_time_comes_first() -> None:
    start = time.perf_counter()
    r = report(target_error=1e-12, time_limit_s=0.5)
    assert r["stop"] == {"reason": "time-limit", "target_met": False}
    assert 0.25 < r["sampling_s"] < 8.0  # a loaded machine may take its time
    assert time.perf_counter() - start < 60
    assert r["error"]["relmse"]["estimate"] > 0


def test_a_limit_too_short_for_anything_still_gives_a_picture() -> None:
    r = report(time_limit_s=1e-6)
    assert r["stop"]["reason"] == "time-limit"
    assert r["samples_per_pixel"][1] >= 1


@pytest.mark.parametrize("metric", list(Metric))
def test_each_metric_can_be_the_target(metric: Metric) -> None:
    at = report(spp=16)["error"][metric.value]["estimate"]
    r = report(target_error=0.6 * at, error_metric=metric)
    assert r["stop"]["target_met"] is True
    assert r["error"][metric.value]["estimate"] <= 0.6 * at


def test_one_sample_knows_no_error() -> None:
    image = primray.render(SCENE, RenderSettings(**SMALL, spp=1))
    assert image.report["error"] == {"relmse": None, "rmse": None, "display": None}
    assert image.report["convergence"] == []
    assert image.errors is not None
    assert np.isinf(image.errors).all()


def test_standard_errors_are_those_of_the_replicates() -> None:
    of = case("texture", 1 << 10)
    sampling = of.render(spp=32)
    a, b = (sampling.film.replicates[r, ..., :3] / 16 for r in (0, 1))
    pixels, errors = sampling.film.image()
    np.testing.assert_allclose(errors, np.abs(a - b) / 2, rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(pixels[..., :3], (a + b) / 2, rtol=1e-6)
    assert sampling.rows[-1].error.rmse.value == pytest.approx(np.sqrt(np.mean((a - b) ** 2 / 4)), rel=1e-6)


def test_progress_never_goes_back() -> None:
    seen: list[float] = []
    settings = RenderSettings(**SMALL, target_error=2e-5, time_limit_s=60)
    primray.render(SCENE, settings, progress=lambda fraction, samples, rays: seen.append(fraction))
    assert seen == sorted(seen)
    assert all(0 <= fraction <= 1 for fraction in seen)


def test_the_exit_code_says_whether_the_target_was_reached(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    base = ["render", SCENE, "-o", "a.exr", "-r", "48", "36", "--max-depth", "2"]
    assert run([*base, "--target-error", "0.01", "--report", "r.json"]) == 0
    assert "reached; stopped by target-error" in capsys.readouterr().out
    assert json.loads((tmp_path / "r.json").read_text())["stop"]["target_met"] is True
    assert run([*base, "--target-error", "1e-9", "--spp", "16"]) == 5
    assert "NOT reached; stopped by samples" in capsys.readouterr().out


@pytest.mark.parametrize(
    "wrong",
    [
        {"target_error": 0.0},
        {"target_error": float("nan")},
        {"time_limit_s": -1.0},
        {"sample_range": (0, 3)},
        {"sample_range": (4, 4)},
        {"sample_range": (0, 8), "spp": 8},
        {"sample_range": (0, 8), "target_error": 0.1},
        {"sample_range": (0, 8), "adaptive": True},
    ],
)
def test_what_cannot_be_meant_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(SettingsError):
        RenderSettings(**wrong)


def test_a_range_off_the_block_names_the_block() -> None:
    with pytest.raises(SettingsError, match="sample block, which is 2"):
        RenderSettings(sample_range=(0, 3))


def test_estimates_hold_what_comes(tmp_path: Path, capsys) -> None:
    flags = [SCENE, "-r", "96", "72", "--max-depth", "3", "--seed", "1"]
    assert run(["estimate", *flags, "--target-error", "1e-4", "--target-error", "2e-5", "--pilot", "1", "--json"]) == 0
    line = json.loads(capsys.readouterr().out)
    assert [t["target_error"] for t in line["targets"]] == [1e-4, 2e-5]
    r = primray.render(SCENE, RenderSettings(resolution=(96, 72), max_depth=3, target_error=2e-5, seed=1)).report
    found = line["targets"][1]["samples"]
    assert r["samples"] / (96 * 72) == pytest.approx(found["estimate"], rel=0.35)
    assert run(["estimate", *flags, "--pilot", "0.1"]) == 0
    assert capsys.readouterr().out.count("\n") > 4
