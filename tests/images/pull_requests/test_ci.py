"""`primray ci` on commits of known effect: nothing is missed, edits without effect move nothing, and pairs without a change are
identical."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from primray.ci.findings import LONGEST_COMMENT, MARKER
from primray.cli import run

from .commits import COMMITS, KEY, Commit, commit, git, make_repository, replace

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


@pytest.mark.parametrize("one", COMMITS, ids=lambda one: one.name)
def test_commits_of_known_effect(one: Commit, repository: Path) -> None:
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
    comment, page = ((repository.parent / "out" / name).read_text() for name in ("comment.md", "index.html"))
    assert code == 1
    assert comment.startswith(MARKER)
    assert "https://example.org/page" in comment
    assert "<b>" not in comment
    assert "@all" not in comment
    assert "<b>" not in page
    assert page.count("<img") >= 5
    assert KEY in page
    (stage,) = report["stages"]
    assert [edit["edit"] for edit in stage["edits"]] == [KEY, "/World/key.s"]


def test_a_long_comment_is_cut(repository: Path) -> None:
    for k in range(40):
        name = f"{'n' * 150}{k}"
        (repository / f"{name}.usda").write_text(f'#usda 1.0\ndef Scope "s"\n{{\n    double a = {k}\n}}\n')
    judged(repository, "--most", "60")
    comment = (repository.parent / "out" / "comment.md").read_text()
    assert len(comment) <= LONGEST_COMMENT


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
