"""`primray ci --staged` as git runs a hook: with variables that name the commit's repository and index."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from .commits import KEY, SHADER, make_repository, replace

IDENTITY = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
HOOK = """#!/bin/sh
exec '{command}' ci --staged --json --imageWidth 48 --spp 4 > '{said}'
"""


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    folder = tmp_path / "repository"
    make_repository(folder)
    set_hook(folder)
    return folder


def set_hook(folder: Path) -> None:
    hook = folder / ".git/hooks/pre-commit"
    hook.parent.mkdir(exist_ok=True)
    hook.write_text(HOOK.format(command=Path(sys.executable).with_name("primray"), said=folder.parent / "said.json"))
    hook.chmod(0o755)


def try_to_commit(folder: Path, *words: str) -> tuple[int, dict[str, Any]]:
    """Commit; return git's exit code and what the hook found."""
    done = subprocess.run(["git", *IDENTITY, "commit", "-qm", "message", *words], cwd=folder, capture_output=True, text=True)
    said = Path(folder.parent, "said.json").read_text()
    assert said, done.stderr
    return done.returncode, json.loads(said)


def status(folder: Path) -> str:
    return subprocess.run(["git", "status", "--short"], cwd=folder, check=True, capture_output=True, text=True).stdout


def moved(report: dict[str, Any]) -> set[str]:
    return {effect["edit"] for stage in report["stages"] for effect in stage["edits"] if effect["pixels"]}


def test_each_way_to_commit_is_judged_by_what_it_commits(repository: Path) -> None:
    replace(repository, "asset", ("roughness = 0.6", "roughness = 0.15"))
    replace(repository, "lights", ("intensity = 3", "intensity = 5"))
    subprocess.run(["git", "add", "lights.usda"], cwd=repository, check=True)
    left = status(repository)
    for words, edits in (((), {KEY}), (("--all",), {KEY, SHADER}), (("asset.usda",), {SHADER})):
        code, report = try_to_commit(repository, *words)
        assert (code, moved(report)) == (1, edits), words
        assert status(repository) == left, words


def test_a_commit_that_changes_no_picture_holds_what_was_edited(repository: Path) -> None:
    with (repository / "asset.usda").open("a") as file:
        file.write("# said again\n")
    assert try_to_commit(repository, "--all")[0] == 0
    shown = subprocess.run(["git", "show", "--stat"], cwd=repository, check=True, capture_output=True, text=True).stdout
    assert "asset.usda | 1 +" in shown
    assert status(repository) == ""


def test_stages_of_the_first_commit_come(tmp_path: Path) -> None:
    folder = tmp_path / "repository"
    make_repository(folder)
    subprocess.run(["git", "update-ref", "-d", "HEAD"], cwd=folder, check=True)
    set_hook(folder)
    code, report = try_to_commit(folder)
    assert code == 1
    assert report["base"] == "no commit"
    assert {stage["verdict"] for stage in report["stages"]} == {"new"}


def test_a_linked_worktree_is_judged_by_its_own_index(repository: Path) -> None:
    linked = repository.parent / "linked"
    subprocess.run(["git", "worktree", "add", "-q", "-b", "more", linked], cwd=repository, check=True)
    replace(linked, "lights", ("intensity = 3", "intensity = 5"))
    code, report = try_to_commit(linked, "--all")
    assert (code, moved(report)) == (1, {KEY})
