"""Frames in parts of processes on this machine: the bits of one render, by the library and by the command."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

import primray
from primray.cli import run as primray_command
from primray.distributed import local_processes
from primray.errors import PrimrayError, RenderCancelled, SceneError, SettingsError

ROOT = Path(__file__).parents[3]
STAGE = ROOT / "scenes/features/implicit-shapes/scene.usda"
SIZE = (40, 24)
TARGET = 0.02


def sha256(**values: Any) -> str:
    return str(primray.render(STAGE, resolution=SIZE, **values).report["pixels_sha256"])


def test_the_bits_of_one_render() -> None:
    image = primray.render(STAGE, resolution=SIZE, spp=40, seed=3, executor=primray.LocalProcesses(2))
    assert image.report["pixels_sha256"] == sha256(spp=40, seed=3)
    assert image.report["distribution"]["parts"] > 1
    assert image.report["distribution"]["slots"] == 2


def test_it_stops_where_one_render_does() -> None:
    image = primray.render(STAGE, resolution=SIZE, target_error=TARGET, executor=primray.LocalProcesses(2))
    one = primray.render(STAGE, resolution=SIZE, target_error=TARGET, adaptive=False)
    for name in ("pixels_sha256", "stop", "error", "samples_per_pixel"):
        assert image.report[name] == one.report[name], name


def test_a_process_that_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("PRIMRAY_TEST_DIED", str(tmp_path / "died"))
    monkeypatch.setattr(local_processes, "PROGRAM", "tests.images.parts.dying")
    image = primray.render(STAGE, resolution=SIZE, spp=16, executor=primray.LocalProcesses(2))
    assert image.report["distribution"]["lost"] == 1
    assert image.report["pixels_sha256"] == sha256(spp=16)


def test_errors_are_those_of_a_render(tmp_path: Path) -> None:
    two = primray.LocalProcesses(2)
    with pytest.raises(SceneError):
        primray.render(tmp_path / "missing.usda", spp=8, executor=two)
    with pytest.raises(PrimrayError) as here:
        primray.render(STAGE, camera="/none", spp=8)
    with pytest.raises(type(here.value)) as there:
        primray.render(STAGE, camera="/none", spp=8, executor=two)
    assert str(there.value) == str(here.value)


def test_it_is_stopped_by_its_progress() -> None:
    with pytest.raises(RenderCancelled):
        primray.render(
            STAGE, resolution=SIZE, progress=lambda *now: now[1] == 0, spp=1 << 20, executor=primray.LocalProcesses(2)
        )


def test_what_parts_cannot_do(tmp_path: Path) -> None:
    two = primray.LocalProcesses(2)
    saved = primray.Checkpointing(tmp_path / "c.prc")
    for refused in (
        lambda: primray.LocalProcesses(0),
        lambda: primray.render(STAGE, executor=two, checkpointing=saved),
        lambda: primray.render(object(), executor=two),
    ):
        with pytest.raises(SettingsError) as raised:
            refused()
        assert raised.value.code == "parts-setting"


def test_by_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With processes in a cluster's place."""
    asked = []

    def executor(address: str) -> Any:
        asked.append(address)
        return nullcontext(primray.LocalProcesses(2))

    monkeypatch.setattr("primray.cli.commands.render.ray_executor", executor)
    out, report = tmp_path / "o.exr", tmp_path / "r.json"
    flags = ["--res", "40", "24", "-o", str(out), "--report", str(report), "--ray", "head:6379"]
    assert primray_command(["render", str(STAGE), *flags, "--target-error", str(TARGET)]) == 0
    assert asked == ["head:6379"]
    assert out.exists()
    assert json.loads(report.read_text())["pixels_sha256"] == sha256(target_error=TARGET, adaptive=False)
    assert primray_command(["render", str(STAGE), *flags, "--target-error", "1e-9", "--spp", "8"]) == 5


@pytest.mark.parametrize("flags", [["--checkpoint", "c.prc"], ["--resume", "c.prc"], ["--snapshot", "3"], ["--stereo"]])
def test_flags_of_one_machine(flags: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert primray_command(["render", str(STAGE), "--ray", "auto", *flags]) == 2
    assert "parts-setting" in capsys.readouterr().err


def test_the_command_says_what_to_install(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **chosen: ())
    assert primray_command(["render", str(STAGE), "--ray", "auto"]) == 2
    said = capsys.readouterr().err
    assert "ray-missing" in said
    assert "pip install 'primray[server,ray]'" in said
