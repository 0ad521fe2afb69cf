"""Stages, folders and outputs that the user may not use: a code, a sentence that says so, and the place."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.locked import run_locked, skip_unless_locks_hold

from primray.file_formats import BEHIND_LOCK, LOCKED

BALL = '#usda 1.0\ndef Sphere "s"\n{\n color3f[] primvars:displayColor = [(1, 0.5, 0)]\n}\n'
SMALL = ("-w", "16", "-p", "1")


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A folder with a stage, one that is locked, two in folders that may not be listed or entered, and a closed one."""
    skip_unless_locks_hold(tmp_path)
    found = tmp_path / "stages"
    for name in ("closed", "listed"):
        (found / name).mkdir(parents=True)
    for name in ("ball.usda", "locked.usda", "closed/ball.usda", "listed/ball.usda"):
        (found / name).write_text(BALL)
    (found / "shot.usda").write_text("#usda 1.0\n(\n subLayers = [@locked.usda@, @ball.usda@]\n)\n")
    (found / "full").mkdir()
    modes = {"locked.usda": 0o000, "closed": 0o000, "listed": 0o444, "full": 0o555}
    for name, mode in modes.items():
        (found / name).chmod(mode)
    yield found
    for name in modes:
        (found / name).chmod(0o755)


@pytest.mark.parametrize(
    ("name", "why"), [("locked.usda", LOCKED), ("closed/ball.usda", BEHIND_LOCK), ("listed/ball.usda", BEHIND_LOCK)]
)
@pytest.mark.parametrize("command", ["render", "thumbnail", "inspect"])
def test_a_locked_stage_is_refused_as_such(command: str, name: str, why: str, folder: Path) -> None:
    ended = run_locked(command, folder / name)
    assert ended.returncode == 3, ended.stderr
    assert ended.stderr.startswith("error: stage-open: ")
    assert why in ended.stderr
    assert name in ended.stderr


def test_a_locked_layer_is_said_to_be_locked(folder: Path, tmp_path: Path) -> None:
    ended = run_locked("render", folder / "shot.usda", "-o", tmp_path / "shot.png", *SMALL)
    assert ended.returncode == 0, ended.stderr
    assert f"locked.usda: {LOCKED}" in ended.stderr


def test_a_sheet_goes_on_with_what_may_be_read(folder: Path, tmp_path: Path) -> None:
    (folder / "away.usda").symlink_to("nowhere.usda")
    (folder / ".kept").mkdir()
    (folder / ".kept" / "ball.usda").write_text(BALL)
    (folder / "._ball.usda").write_text("no stage")
    out = tmp_path / "sheet.html"
    ended = run_locked("sheet", folder, "-o", out, "-n", "2", *SMALL)
    assert ended.returncode == 1, ended.stderr
    rows = {row["stage"]: row for row in json.loads(out.with_suffix(".json").read_text())}
    assert {name: (row["exit_code"], row["marks"]) for name, row in rows.items()} == {
        "away.usda": (3, ["refused"]),
        "ball.usda": (0, []),
        "closed/": (3, ["refused"]),
        "listed/ball.usda": (3, ["refused"]),
        "locked.usda": (3, ["refused"]),
        "shot.usda": (0, ["missing"]),
    }
    assert LOCKED in rows["closed/"]["message"]
    assert "5 stages, 3 failed, 1 odd, 1 folder cannot be read" in ended.stdout


@pytest.mark.parametrize(
    ("words", "place"),
    [
        (("render", "ball.usda", "-o", "full/a.png"), "full/a.png"),
        (("sheet", ".", "-o", "full/a.html"), "full/a.html"),
        (("sheet", ".", "-o", "a.html", "--keep", "full"), "full/outcome.json"),
        (("sheet", "closed", "-o", "a.html"), "closed"),
        (("thumbnail", "ball.usda", "full/a.png"), "full/a.png"),
    ],
)
def test_what_may_not_be_used_is_refused_before_anything_is_rendered(words: tuple[str, ...], place: str, folder: Path) -> None:
    paths = {name: str(folder / name) for name in (".", "ball.usda", "closed", "full", "full/a.png", "full/a.html", "a.html")}
    ended = run_locked(*(paths.get(word, word) for word in words))
    assert ended.returncode == 2, ended.stderr
    assert ended.stderr.splitlines()[-1].endswith(f"{place}]")
    assert "internal" not in ended.stderr
    assert not ended.stdout


def test_a_place_behind_a_locked_folder_is_no_bug_of_primray(folder: Path) -> None:
    ended = run_locked("sheet", folder / "closed" / "deeper")
    assert ended.returncode == 1
    assert (
        ended.stderr == f"error: permission-denied: this user may not use it: Permission denied [{folder / 'closed/deeper'}]\n"
    )
