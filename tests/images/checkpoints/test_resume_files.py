"""Checkpoints the whole way: files, processes, signals, a full disk."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import primray
from primray.checkpoints.checkpoint import load
from primray.checkpoints.checkpointing import Checkpointing
from primray.errors import CheckpointError, RenderCancelled
from primray.settings import RenderSettings

from .resuming import LONG, STAGE, reached

SETTINGS = RenderSettings(resolution=(48, 32), spp=64)


def command(folder: Path, *flags: str) -> list[str]:
    # A shell's background jobs, and so their children, start with SIGINT ignored.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from primray.cli import main; main()"
    size = [str(n) for n in SETTINGS.resolution or ()]
    picture = ["--res", *size, "--spp", str(LONG), "-o", str(folder / "a.exr"), "--report", str(folder / "a.json")]
    return [sys.executable, "-c", code, "render", str(STAGE), *picture, "--json", *flags]


def begun(arguments: list[str]) -> subprocess.Popen[str]:
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()  # the first progress: it renders
    return process


def wait_for(path: Path, newer_than: int) -> None:
    end = time.monotonic() + 20
    while not (path.exists() and path.stat().st_mtime_ns > newer_than):
        assert time.monotonic() < end
        time.sleep(0.002)


def kill_and_resume(folder: Path, kills: int, seed: int) -> None:
    rng, path = np.random.default_rng(seed), folder / "a.prc"
    flags = ["--checkpoint", str(path)]
    means = [0.0]
    for _ in range(kills):
        process = begun(command(folder, *flags, "--checkpoint-every", "0.05", "--threads", "1"))
        wait_for(path, path.stat().st_mtime_ns if path.exists() else 0)
        time.sleep(0.1 * rng.random())
        process.kill()
        process.communicate()
        means.append(float(np.mean(load(path).film["counts"].sum(axis=0))))
        flags = ["--resume", str(path)]
    assert means == sorted(means)
    assert means[-1] > 0
    process = begun(command(folder, *flags, "--threads", "1"))
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 130, said
    assert f"interrupted: the unfinished picture was saved; continue with --resume {shlex.quote(str(path))}" in said
    report = json.loads((folder / "a.json").read_text())
    assert report["stop"]["reason"] == "interrupted"
    whole = replace(SETTINGS, spp=reached(load(path).film["next"]))
    image = primray.render(STAGE, whole, checkpointing=Checkpointing(path, resume=path))
    assert image.report["pixels_sha256"] == primray.render(STAGE, whole).report["pixels_sha256"]
    assert image.report["checkpoint"]["resumed_at"] >= means[-1]
    assert sorted(file.name for file in folder.iterdir()) == ["a.exr", "a.json", "a.prc"]


def test_killed_and_terminated_and_resumed(tmp_path: Path) -> None:
    folder = tmp_path / "a shot"  # a command that is printed can be pasted, whatever its paths hold
    folder.mkdir()
    kill_and_resume(folder, 1, 0)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(1, 5))
def test_killed_often_and_resumed(tmp_path: Path, seed: int) -> None:
    kill_and_resume(tmp_path, 6, seed)


def test_a_callback_that_stops_leaves_a_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "a.prc"
    calls = iter([True, True, False])
    with pytest.raises(RenderCancelled):
        primray.render(STAGE, SETTINGS, progress=lambda *_: next(calls), checkpointing=Checkpointing(path))
    image = primray.render(STAGE, SETTINGS, checkpointing=Checkpointing(path, resume=path))
    assert image.report["pixels_sha256"] == primray.render(STAGE, SETTINGS).report["pixels_sha256"]


def test_a_moved_stage_is_the_same_and_an_edited_one_is_not(tmp_path: Path) -> None:
    path, small = tmp_path / "a.prc", RenderSettings(resolution=(24, 16), spp=4)
    primray.render(STAGE, small, checkpointing=Checkpointing(path))
    moved = tmp_path / "elsewhere.usda"
    text = STAGE.read_text()
    moved.write_text(text)
    again = Checkpointing(path, resume=path)
    image = primray.render(moved, RenderSettings(resolution=(24, 16), spp=8), checkpointing=again)
    assert (
        image.report["pixels_sha256"]
        == primray.render(STAGE, RenderSettings(resolution=(24, 16), spp=8)).report["pixels_sha256"]
    )
    edited = tmp_path / "edited.usda"
    edited.write_text(text.replace("double radius = ", "double radius = 1", 1))
    assert edited.read_text() != text
    with pytest.raises(CheckpointError, match="the scene's geometry has changed") as caught:
        primray.render(edited, small, checkpointing=again)
    assert caught.value.code == "checkpoint-other"
    with pytest.raises(CheckpointError, match="seed is 0 in the checkpoint and 1 here"):
        primray.render(moved, RenderSettings(resolution=(24, 16), spp=8, seed=1), checkpointing=again)


def test_a_disk_that_is_full_costs_no_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(number: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    small = RenderSettings(resolution=(24, 16), spp=4)
    image = primray.render(STAGE, small, checkpointing=Checkpointing(tmp_path / "a.prc"))
    assert image.report["pixels_sha256"] == primray.render(STAGE, small).report["pixels_sha256"]
    assert "No space left" in image.report["checkpoint"]["failed"]
    assert "checkpoint-unwritten" in [d["code"] for d in image.report["diagnostics"]]
    assert list(tmp_path.iterdir()) == []


def test_one_checkpoint_is_written_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writing, most = threading.Semaphore(1), []

    def slowly(*of: Any) -> None:
        most.append(writing.acquire(blocking=False))
        time.sleep(0.15)
        writing.release()

    monkeypatch.setattr("primray.checkpoints.checkpoint_file.write_checkpoint", slowly)
    image = primray.render(
        STAGE,
        replace(SETTINGS, spp=LONG),
        progress=lambda *_: len(most) < 3,
        on_interrupt="partial",
        checkpointing=Checkpointing(tmp_path / "a.prc", every_s=0.01),
    )
    assert all(most)
    assert image.report["checkpoint"]["written"] == len(most) == 4  # the last one at the end
