"""`primray ci` on commits of known effect: nothing is missed, edits without effect move nothing, and pairs without a change are
identical."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from primray.ci.attribution import Effect, StageResult
from primray.ci.findings import LONGEST_COMMENT, MARKER, Findings, comment
from primray.ci.repository import FETCH_ALL, Sides
from primray.ci.touched import Reach
from primray.cli import run

from .commits import COMMITS, KEY, Commit, commit, git, make_repository, replace
from .kinds_of_files import KINDS

SMALL = ["--imageWidth", "48", "--spp", "16"]


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "repository"
    make_repository(folder)
    monkeypatch.chdir(folder)
    return folder


def judged(folder: Path, *flags: str) -> tuple[int, dict[str, Any]]:
    out = folder.parent / "out"
    code = run(["ci", "main", "-o", str(out), *SMALL, *flags])
    return code, json.loads((out / "report.json").read_text())


@pytest.mark.parametrize("one", [*COMMITS, *KINDS], ids=lambda one: one.name)
def test_commits_of_known_effect(one: Commit, repository: Path) -> None:
    if one.before is not None:
        one.before(repository)
        commit(repository, "before")
    git(repository, "switch", "--quiet", "--create", "change")
    one.change(repository)
    commit(repository, one.name)
    code, report = judged(repository, "--head", "HEAD")
    assert {stage["stage"]: stage["verdict"] for stage in report["stages"]} == one.verdicts, report
    assert code == report["exit_code"] == one.exit_code
    moved = {edit["edit"]: edit["pixels"] for stage in report["stages"] for edit in stage["edits"]}
    assert [name for name in one.moves if not moved.get(name)] == [], moved
    assert [name for name in one.still if moved.get(name) != 0] == [], moved
    assert not [edit for stage in report["stages"] for edit in stage["edits"] if edit["failed"]]


def test_there_are_thirty() -> None:
    assert len(COMMITS) >= 30


def test_the_working_tree_and_what_is_staged(repository: Path) -> None:
    replace(repository, "lights", ("intensity = 3", "intensity = 6"))
    assert judged(repository)[0] == 1
    assert run(["ci", "--staged", *SMALL]) == 0
    git(repository, "add", "--all")
    replace(repository, "lights", ("intensity = 6", "intensity = 3"))
    assert run(["ci", "--staged", *SMALL]) == 1
    assert judged(repository)[0] == 0
    assert git(repository, "worktree", "list").count("\n") == 1


def test_the_page_and_the_comment(repository: Path) -> None:
    replace(repository, "lights", ("intensity = 3", 'intensity = 6\n        custom string s = "<b>@all</b>"'))
    code, report = judged(repository, "--link", "https://example.org/page")
    text, page = ((repository.parent / "out" / name).read_text() for name in ("comment.md", "index.html"))
    assert code == 1
    assert text.startswith(MARKER)
    assert "https://example.org/page" in text
    assert "<b>" not in text
    assert "@all" not in text
    assert "<b>" not in page
    assert page.count("<img") >= 5
    assert KEY in page
    (stage,) = report["stages"]
    assert [edit["edit"] for edit in stage["edits"]] == [KEY, "/World/key.s"]


def test_a_long_comment_is_cut() -> None:
    """GitHub refuses a comment above a length; letters that UTF-8 writes in three bytes count so."""
    effects = tuple(Effect(f"/World/{'漢' * 60}{k}", "a.usda", ("1", "2"), 1) for k in range(12))
    sides = Sides(Path("before"), Path("after"), "0" * 40, "HEAD", ())
    for count in (1, 100):
        stages = tuple(StageResult(f"{k}.usda", "changed", "", (), effects=effects) for k in range(count))
        text = comment(Findings(sides, Reach((), 0, (), (), ()), stages, 0.01))
        assert text.startswith(MARKER)
        assert ("This is cut" in text) == (count == 100)
    assert 0.9 * LONGEST_COMMENT < len(text.encode()) <= LONGEST_COMMENT


def test_a_comment_on_many_broken_layers_is_cut(repository: Path) -> None:
    name = "\u6f22" * 60
    for k in range(400):
        (repository / f"{name}{k}.usda").write_text("#usda 1.0\ndef {\n")
    assert run(["ci", "main", "-o", "out", *SMALL, "--most", "1"]) == 3
    written = (repository / "out" / "comment.md").read_bytes()
    assert 0.9 * LONGEST_COMMENT < len(written) <= LONGEST_COMMENT


def test_a_shallow_clone_says_how_to_fetch_the_rest(
    repository: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    git(repository, "switch", "--quiet", "--create", "change")
    replace(repository, "lights", ("intensity = 3", "intensity = 6"))
    commit(repository, "brighter")
    git(repository, "switch", "--quiet", "main")
    shallow = repository.parent / "shallow"
    git(repository.parent, "clone", "--quiet", "--depth", "1", "--branch", "change", f"file://{repository}", str(shallow))
    monkeypatch.chdir(shallow)
    for words in ([], ["main"], ["origin/main"]):
        assert run(["ci", *words, *SMALL]) == 2
        assert FETCH_ALL in capsys.readouterr().err.replace("\n", " ")
    subprocess.run(FETCH_ALL, shell=True, check=True, capture_output=True)
    assert run(["ci", "origin/main", *SMALL]) == 1


def test_edits_beyond_the_most_are_put_together(repository: Path) -> None:
    replace(repository, "asset", ("roughness = 0.6", "roughness = 0.1"), ("(0.8, 0.8, 0),", "(0.8, 0.5, 0),"))
    replace(repository, "lights", ("intensity = 3", "intensity = 6\n        custom float a = 1\n        custom float b = 1"))
    for most, told in (
        ("5", {KEY: 1, "/World/key.a": 1, "/World/key.b": 1, "/Asset/M/s.inputs:roughness": 1, "/Asset/card.points": 1}),
        ("3", {"/World/key": 3, "/Asset/M/s.inputs:roughness": 1, "/Asset/card.points": 1}),
        ("2", {"/World/key": 3, "asset.usda": 2}),
    ):
        _, report = judged(repository, "--most-edits", most)
        assert {edit["edit"]: edit["edits"] for edit in report["stages"][0]["edits"]} == told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nowhere"], "no commit"),
        (["--staged", "--head", "HEAD"], "one of them"),
        (["--link", "javascript:x"], "https"),
        (["--head=--output=x"], "no commit"),
    ],
)
def test_usage(words: list[str], told: str, repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ci", *words]) == 2
    assert told in capsys.readouterr().err


def unchanged_pairs(folder: Path, count: int) -> list[str]:
    """Return those of some edits without an effect on the stage that they touch that do not end with 0."""
    alarms = []
    for k in range(count):
        replace(folder, "lights", ("#usda 1.0\n", f"#usda 1.0\n# {k}\n"))
        code = run(["ci", "main", *SMALL, "--json"])
        if code != 0:
            alarms.append(f"{k}: {code}")
    return alarms


def test_no_false_alarm_in_a_dozen_unchanged_pairs(repository: Path) -> None:
    assert unchanged_pairs(repository, 12) == []


@pytest.mark.long
def test_no_false_alarm_in_500_unchanged_pairs(repository: Path) -> None:
    assert unchanged_pairs(repository, 500) == []
