"""The picture so far, every so often: whole files while the render goes on, and the same picture in the end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray import render_frames
from primray.cli import run
from primray.errors import PrimrayError, SettingsError
from primray.images.image import Image
from primray.images.reading import read_measured
from primray.render.progress import Snapshots

SCENE = '#usda 1.0\ndef Sphere "s" {}\n'


@pytest.fixture(autouse=True)
def _a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.usda").write_text(SCENE)


def test_snapshots_are_pictures_and_change_no_bit() -> None:
    settings = primray.RenderSettings(resolution=(64, 48), spp=2048)
    seen: list[Image] = []
    [image] = render_frames("s.usda", [settings], snapshots=Snapshots(1e-6, seen.append))
    assert seen
    samples = [int(snapshot.metadata["samples"]) for snapshot in seen]
    assert samples == sorted(samples)
    assert 0 < samples[0] < 64 * 48 * 2048
    assert np.isfinite(seen[-1].pixels).all()
    assert (image.pixels == primray.render("s.usda", settings).pixels).all()


def test_with_checkpoints_too() -> None:
    from primray.checkpoints.checkpointing import Checkpointing

    seen: list[Image] = []
    settings = primray.RenderSettings(resolution=(64, 48), spp=2048)
    checkpointing = [Checkpointing(Path("c.prc"), 1e-6)]
    [image] = render_frames("s.usda", [settings], snapshots=Snapshots(1e-6, seen.append), checkpointing=checkpointing)
    assert seen
    assert image.report["checkpoint"]["written"] > 1
    assert (image.pixels == primray.render("s.usda", settings).pixels).all()


def test_they_are_written_to_the_outputs_of_their_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[tuple[str, bool]] = []
    write = Image.write

    def written_now(image: Image, path: Path, *how: Any) -> Path:
        written.append((str(path), "unfinished" in image.metadata))
        return write(image, path, *how)

    monkeypatch.setattr(Image, "write", written_now)
    command = ["render", "s.usda", "-o", "a.#.exr", "-f", "1:2", "--res", "64", "48", "--spp", "2048"]
    assert run([*command, "--snapshot", "0.000001"]) == 0
    for frame in ("a.1.exr", "a.2.exr"):
        assert (frame, True) in written
        assert [unfinished for name, unfinished in written if name == frame][-1] is False
        assert read_measured(frame).sample_span == (2048, 2048)


def test_one_that_cannot_be_written_ends_nothing(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    write = Image.write

    def written_now(image: Image, path: Path, *how: Any) -> Path:
        if "unfinished" in image.metadata:
            raise PrimrayError("the file cannot be written: full", code="write-failed")
        return write(image, path, *how)

    monkeypatch.setattr(Image, "write", written_now)
    assert run(["render", "s.usda", "--res", "64", "48", "--spp", "2048", "--snapshot", "0.000001"]) == 0
    assert "warning: the unfinished picture could not be saved: write-failed" in capsys.readouterr().err
    assert Path("s.exr").exists()


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_what_is_no_interval(seconds: float) -> None:
    with pytest.raises(SettingsError, match="above 0"):
        Snapshots(seconds, lambda image: None)
