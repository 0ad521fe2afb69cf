"""Denoised pictures beside their record, which they never change: files, reports, targets, resumes, and a missing package."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray import core, usd
from primray.checkpoints.checkpointing import Checkpointing
from primray.cli import run
from primray.compare.comparison import compare
from primray.denoising import denoiser
from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.images.reading import read_measured
from primray.render import prepare
from primray.report.report import Costs

FEATURES = Path(__file__).resolve().parents[2] / "scenes" / "features"
SPHERES = str(FEATURES / "glass" / "scene.usda")
LENS = str(FEATURES / "camera-lens" / "scene.usda")
HERE = {"resolution": (48, 32), "progress": False, "seed": 3}

needs_package = pytest.mark.skipif(not denoiser.has_denoiser(), reason="primray[denoise] is not installed")


def _render(stage: str = SPHERES, **values: Any) -> primray.Image:
    return primray.render(stage, **{**HERE, "spp": 4, **values})


@needs_package
def test_the_record_stays_and_the_file_has_both(tmp_path: Path) -> None:
    plain, image = _render(), _render(denoise=True)
    assert image.report["pixels_sha256"] == plain.report["pixels_sha256"]
    assert image.denoised is not None
    assert image.shown is image.denoised
    np.testing.assert_array_equal(image.denoised.pixels[..., 3], image.pixels[..., 3])
    again = primray.read_image(image.save(tmp_path / "a.exr"))
    assert again.denoised is not None
    np.testing.assert_array_equal(again.pixels, plain.pixels)
    np.testing.assert_array_equal(again.denoised.pixels, image.denoised.pixels)
    assert again.aovs == {}
    # What compares pictures reads the record.
    measured = read_measured(tmp_path / "a.exr")
    np.testing.assert_array_equal(measured.pixels, plain.pixels[..., :3])
    assert compare(measured, read_measured(plain.save(tmp_path / "b.exr"))).verdict.value == "unchanged"


@needs_package
def test_views_show_it_with_less_noise(tmp_path: Path) -> None:
    reference, image = _render(spp=256, seed=8), _render(denoise=True)
    far = [
        np.abs(made.to_uint8().astype(float) - reference.to_uint8()).mean() for made in (replace(image, denoised=None), image)
    ]
    assert far[1] < 0.8 * far[0]
    assert image.save(tmp_path / "a.png").stat().st_size > 100


@needs_package
def test_the_report_has_both_errors_and_the_truth_is_between() -> None:
    reference, image = _render(spp=1024, seed=8), _render(denoise=True)
    says = image.report["denoised"]
    assert says["biased"] is True
    assert says["by"].startswith("Open Image Denoise")
    assert all(0.9 < share < 1.1 for share in says["energy"])
    assert image.denoised is not None
    r = reference.pixels[..., :3].astype(np.float64)
    true = float(((image.denoised.pixels[..., :3] - r) ** 2 / (r**2 + 0.01)).mean())
    low, high = says["error"]["relmse"]["ci95"]
    assert low < true < high
    assert says["error"]["relmse"]["estimate"] < 0.7 * image.report["error"]["relmse"]["estimate"]


@needs_package
def test_one_sample_has_a_picture_and_no_error() -> None:
    image = _render(spp=1, denoise=True)
    assert image.denoised is not None
    assert image.report["denoised"]["error"] is None


@needs_package
def test_threads_do_not_show() -> None:
    one, two = (_render(denoise=True, threads=threads).denoised for threads in (1, 2))
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.pixels, two.pixels)


@needs_package
def test_a_target_of_the_denoised_picture_takes_fewer_samples(tmp_path: Path) -> None:
    noisy = _render(spp=None, target_error=0.001, adaptive=False)
    image = _render(spp=None, target_error=0.001, stop_at="denoised")
    assert image.report["stop"] == {"reason": "target-error", "target_met": True}
    assert image.report["samples"] < 0.7 * noisy.report["samples"]
    assert image.report["denoised"]["error"]["relmse"]["estimate"] <= 0.001
    # Resumed from any place, it ends at the same sample.
    half = _render(stop_at="picture", spp=4, checkpointing=Checkpointing(tmp_path / "a.prc"))
    assert half.report["samples"] < image.report["samples"]
    going_on = Checkpointing(tmp_path / "a.prc", resume=tmp_path / "a.prc")
    again = _render(spp=None, target_error=0.001, stop_at="denoised", checkpointing=going_on)
    assert again.report["pixels_sha256"] == image.report["pixels_sha256"]
    assert _render(spp=8, target_error=1e-9, stop_at="denoised").report["stop"]["target_met"] is False


def test_guides_are_as_soft_as_the_picture() -> None:
    """Through a lens, normals of a centre sample would have sharp edges where the picture has none."""
    diagnostics = Diagnostics()
    settings = primray.RenderSettings(resolution=(96, 64))
    stage = usd.open_stage(LENS, diagnostics, settings.composition)
    prepared = prepare(stage, diagnostics, settings, Costs(), Diagnostics())
    found = core.first_hits(prepared.scene, ["normal", "guide_normal", "guide_albedo", "albedo"], [], settings).planes
    steps = [np.abs(np.diff(found[name], axis=1)).sum(axis=2).max() for name in ("normal", "guide_normal")]
    assert steps[1] < 0.7 * steps[0]
    np.testing.assert_array_equal(found["guide_albedo"], found["albedo"])  # nothing moves
    still = np.linalg.norm(found["guide_normal"], axis=2)
    assert still.max() <= 1 + 1e-5


def test_without_the_package_it_is_told_before(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(denoiser, "has_denoiser", lambda: False)
    with pytest.raises(SettingsError, match="primray\\[denoise\\]") as caught:
        _render(denoise=True)
    assert caught.value.code == "denoiser-missing"
    monkeypatch.chdir(tmp_path)
    assert run(["render", SPHERES, "--denoise", "-o", "a.exr"]) == 2
    assert "denoiser-missing" in capsys.readouterr().err


@needs_package
def test_the_command_line_tells_both(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    flags = ["--res", "32", "24", "--target-error", "0.02", "--stop-at", "denoised", "-o", "a.png", "--report", "r.json"]
    assert run(["render", SPHERES, *flags]) == 0
    told = capsys.readouterr().out
    assert "target of the denoised picture 0.02 reached" in told
    assert "denoised: relmse" in told
    assert json.loads(Path("r.json").read_text())["settings"]["stop_at"] == "denoised"


@needs_package
@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"stop_at": "denoised", "spp": 2}, "needs target_error"),
        ({"stop_at": "denoised", "target_error": 0.1, "error_metric": "display"}, "not on a display"),
    ],
)
def test_settings_that_make_no_sense(values: dict[str, Any], why: str) -> None:
    with pytest.raises(SettingsError, match=why):
        _render(**values)
