"""`primray ci` on commits of known effect: nothing is missed, edits without effect move nothing, and pairs without a change are
identical."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from primray.ci.attribution import Effect, StageResult
from primray.ci.changes import MARKER
from primray.ci.findings import LONGEST_COMMENT, Findings, comment
from primray.ci.repository import FETCH_ALL, Sides
from primray.ci.touched import Reach
from primray.cli import run

from .commits import COMMITS, KEY, SHADER, Commit, commit, git, make_repository, replace
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


def test_its_own_page_and_what_git_ignores_are_no_changes(repository: Path) -> None:
    """Not the page of an earlier run, nor a stage of a build that names what changes."""
    (repository / ".gitignore").write_text("build/\n")
    git(repository, "add", ".gitignore")
    git(repository, "commit", "--quiet", "-m", "ignored")
    (repository / "build").mkdir()
    (repository / "build" / "copy.usda").write_text("#usda 1.0\n(\n subLayers = [@../shot.usda@]\n)\n")
    assert run(["ci", "main", "-o", "page", *SMALL]) == 0
    code, report = judged(repository)
    assert (code, report["changes"], report["unused"]) == (0, [], [])
    git(repository, "add", "page")
    git(repository, "commit", "--quiet", "-m", "a page")
    replace(repository, "lights", ("intensity = 3", "intensity = 6"))
    assert run(["ci", "main", "-o", "page", *SMALL]) == 1
    code, report = judged(repository)
    assert [change["after"] for change in report["changes"]] == ["lights.usda"]
    assert [stage["stage"] for stage in report["stages"]] == ["shot.usda"]
    (repository / "index.html").write_text("somebody's own")
    assert "index.html" in judged(repository)[1]["unused"]


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


@pytest.fixture
def with_submodule(repository: Path) -> Path:
    """The shot's asset and its texture lie in a submodule, and a branch records a commit of it with a smoother one."""
    library = repository.parent / "library"
    library.mkdir()
    for name in ("asset.usda", "paint.png"):
        (repository / name).rename(library / name)
    git(library, "init", "--quiet", "--initial-branch", "main")
    git(library, "config", "uploadpack.allowAnySHA1InWant", "true")
    commit(library, "first")
    git(repository, *LOCAL, "submodule", "--quiet", "add", "--name", "assets", f"file://{library}", "lib/assets")
    for name in ("shot", "other"):
        text = (repository / f"{name}.usda").read_text()
        (repository / f"{name}.usda").write_text(text.replace("@./asset.usda@", "@./lib/assets/asset.usda@"))
    commit(repository, "a submodule")
    git(repository, "switch", "--quiet", "--create", "change")
    replace(library, "asset", SMOOTHER)
    commit(library, "smoother")
    git(repository / "lib/assets", "pull", "--quiet")
    commit(repository, "a newer submodule")
    return repository


LOCAL = ("-c", "protocol.file.allow=always")
SMOOTHER = ("inputs:roughness = 0.6", "inputs:roughness = 0.2")


def verdicts(report: dict[str, Any]) -> dict[str, str]:
    return {stage["stage"]: stage["verdict"] for stage in report["stages"]}


def test_a_submodule_has_the_commits_that_both_sides_record(with_submodule: Path) -> None:
    code, report = judged(with_submodule, "--head", "HEAD")
    assert (code, verdicts(report)["shot.usda"]) == (1, "changed")
    assert [change["after"] for change in report["changes"]] == ["lib/assets/asset.usda"]
    (edit,) = next(stage["edits"] for stage in report["stages"] if stage["stage"] == "shot.usda")
    assert (edit["edit"], edit["file"]) == (SHADER, "lib/assets/asset.usda")
    assert edit["pixels"] > 0
    again, working = judged(with_submodule)
    assert (again, working["stages"]) == (code, report["stages"])
    assert git(with_submodule / "lib/assets", "worktree", "list").count("\n") == 1  # nothing is left behind


def test_what_is_not_committed_in_a_submodule_is_of_the_working_tree_alone(with_submodule: Path) -> None:
    replace(with_submodule / "lib/assets", "asset", ("inputs:roughness = 0.2", "inputs:roughness = 0.1"))
    for words, after in (((), "0.1"), (("--staged",), "0.2")):
        code, report = judged(with_submodule, *words)
        (edit,) = next(stage["edits"] for stage in report["stages"] if stage["stage"] == "shot.usda")
        assert (code, edit["edit"], edit["values"]) == (1, SHADER, ["0.6", after])


def test_edits_beside_a_submodule_change_what_they_change(with_submodule: Path) -> None:
    git(with_submodule, "switch", "--quiet", "main")
    git(with_submodule, *LOCAL, "submodule", "--quiet", "update")
    git(with_submodule, "switch", "--quiet", "--create", "beside")
    text = (with_submodule / "shot.usda").read_text()
    (with_submodule / "shot.usda").write_text(text.replace("#usda 1.0\n", "#usda 1.0\n# a comment\n", 1))
    commit(with_submodule, "a comment")
    code, report = judged(with_submodule, "--head", "HEAD")
    assert (code, verdicts(report)["shot.usda"]) == (0, "identical")
    assert not report["stages"][0]["notes"]


def test_a_submodule_that_is_not_here_is_named(with_submodule: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clone = with_submodule.parent / "clone"
    git(with_submodule.parent, "clone", "--quiet", "--no-local", "--branch", "change", str(with_submodule), str(clone))
    git(clone, "branch", "main", "origin/main")
    monkeypatch.chdir(clone)
    for words in (("--head", "HEAD"), ()):
        code, report = judged(clone, *words)
        assert (code, verdicts(report)["shot.usda"]) == (6, "undecided")
        assert "git submodule update --init -- lib/assets" in " ".join(report["stages"][0]["notes"])

    git(clone, *LOCAL, "submodule", "--quiet", "update", "--init", "--depth", "1")
    code, report = judged(clone)
    assert (code, verdicts(report)["shot.usda"]) == (6, "undecided")
    (note,) = report["stages"][0]["notes"]
    assert "lib/assets lacks the commit" in note
    command = note.split("`")[1].split()
    git(clone, *LOCAL, *command[1:])
    assert judged(clone)[0] == 1

    git(clone, "submodule", "deinit", "--force", "--quiet", "--", "lib/assets")  # the objects stay in .git/modules
    assert judged(clone, "--head", "HEAD")[0] == 1


def test_a_submodule_that_is_missing_on_both_sides_hides_no_other_change(
    with_submodule: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clone = with_submodule.parent / "clone"
    git(with_submodule.parent, "clone", "--quiet", "--no-local", "--branch", "main", str(with_submodule), str(clone))
    monkeypatch.chdir(clone)
    git(clone, "switch", "--quiet", "--create", "change")
    replace(clone, "lights", ("intensity = 3", "intensity = 6"))
    commit(clone, "brighter")
    code, report = judged(clone)
    (stage,) = [stage for stage in report["stages"] if stage["stage"] == "shot.usda"]
    assert (code, stage["verdict"]) == (1, "changed")
    assert "lib/assets" in stage["notes"][0]


def test_a_link_that_is_set_to_another_version_is_a_change(repository: Path) -> None:
    asset = repository / "asset.usda"
    (repository / "v2").mkdir()
    (repository / "v2/asset.usda").write_text(asset.read_text().replace("(0.8, 0.8, 0),", "(0.8, 0.5, 0),"))
    asset.rename(repository / "asset_v1.usda")
    asset.symlink_to("asset_v1.usda")
    commit(repository, "versions")
    git(repository, "switch", "--quiet", "--create", "change")
    asset.unlink()
    asset.symlink_to("v2/asset.usda")
    commit(repository, "the next version")
    code, report = judged(repository, "--head", "HEAD")
    assert (code, verdicts(report)) == (1, {"shot.usda": "changed"})
    assert any(edit["pixels"] for stage in report["stages"] for edit in stage["edits"])


def test_a_folder_that_is_a_link_is_a_change(repository: Path) -> None:
    for version, size in (("v1", 1), ("v2", 3)):
        (repository / version).mkdir()
        (repository / version / "more.usda").write_text(f'#usda 1.0\ndef Sphere "more"\n{{\n    double radius = {size}\n}}\n')
    (repository / "now").symlink_to("v1")
    replace(repository, "shot", ("subLayers = [", "subLayers = [@now/more.usda@, "))
    commit(repository, "versions")
    git(repository, "switch", "--quiet", "--create", "change")
    (repository / "now").unlink()
    (repository / "now").symlink_to("v2")
    commit(repository, "the next version")
    code, report = judged(repository, "--head", "HEAD", "--stage", "shot.usda")
    assert (code, verdicts(report)) == (1, {"shot.usda": "changed"})


def test_a_stage_that_is_a_link_comes(repository: Path) -> None:
    git(repository, "switch", "--quiet", "--create", "change")
    (repository / "again.usda").symlink_to("shot.usda")
    commit(repository, "a link")
    code, report = judged(repository, "--head", "HEAD")
    assert (code, verdicts(report)) == (1, {"again.usda": "new"})


def test_warnings_of_stages_are_in_the_findings_alone(repository: Path, recwarn: pytest.WarningsRecorder) -> None:
    git(repository, "switch", "--quiet", "--create", "change")
    replace(repository, "shot", ("@./asset.usda@", "@./nowhere.usda@"))
    commit(repository, "a file that is missing")
    judged(repository, "--head", "HEAD")
    assert [str(warning.message) for warning in recwarn if "RenderWarning" in type(warning.message).__name__] == []


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
        (["--stage", "*.usda", "--stage", "shotts/*.usda"], "no stage of either side matches 'shotts/*.usda'"),
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
