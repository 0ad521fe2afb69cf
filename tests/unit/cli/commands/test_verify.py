"""`primray pin` writes a lock, and `primray verify` says what is proven, or what differs, by its exit code too."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from primray.cli import run

from ...pinned.shot import changed, write_shot, write_texture

PIN = ["pin", "shot.usda", "-o", "a.exr", "-r", "48", "32", "-p", "4", "--threads", "2"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_shot(tmp_path)
    assert run(PIN) == 0
    return tmp_path


def test_a_pinned_picture_is_proven(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(PIN) == 0
    said = capfd.readouterr().out
    assert said.startswith("a.lock.json: 48 x 32 pixels, 4 samples each, of 2 files, pixels_sha256 ")
    assert run(["verify", "a.lock.json"]) == 0
    assert "proven: all 1536 pixels have the same bits, rendered again with all 6144 samples" in capfd.readouterr().out
    assert run(["verify", "a.lock.json", "--share", "0.3", "--seed", "1"]) == 0
    assert "proven: the same bits in 2 of 6 tiles" in capfd.readouterr().out
    assert run(["verify", "a.lock.json", "--share", "0", "--picture", "none"]) == 0
    said = capfd.readouterr().out
    assert said.splitlines() == [
        "a.lock.json: the same inputs and settings; nothing was rendered",
        "no file of the picture was compared",
        "no pixel was rendered again",
    ]


def test_a_difference_is_named_and_ends_with_1(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_texture(folder, 7)
    assert run(["verify", "a.lock.json"]) == 1
    assert "differs: input paint.png (it changes material /World/paint): " in capfd.readouterr().out
    assert run(["verify", "a.lock.json", "--json"]) == 1
    found = json.loads(capfd.readouterr().out.splitlines()[-1])
    assert (found["type"], found["same"], found["difference"]["kind"]) == ("verification", False, "input")


def test_a_file_that_is_no_lock_ends_with_2(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    changed(folder / "a.lock.json", lambda found: found.pop("inputs") and None, sealed=False)
    assert run(["verify", "a.lock.json"]) == 2
    assert "lock-unreadable" in capfd.readouterr().err
