"""`make test-all` runs each test once, and says which failed."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests import run
from tests.run import ALL, QUICK, ROOT, Group

FOLDERS = sorted({file.parent for file in (ROOT / "tests").rglob("test_*.py")})


def groups_of(folder: Path) -> list[str]:
    """Return the names of the groups that run the folder's tests."""

    def is_in(paths: tuple[str, ...]) -> bool:
        return any(folder.is_relative_to(ROOT / path) for path in paths)

    return [group.name for group in ALL if is_in(group.paths) and not is_in(group.left_out)]


def test_each_folder_is_of_one_group() -> None:
    assert {str(folder): found for folder in FOLDERS if len(found := groups_of(folder)) != 1} == {}
    assert set(QUICK) <= set(ALL)


def test_a_failure_is_shown_and_fails_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "LOGS", tmp_path / "logs")
    (tmp_path / "test_good.py").write_text("def test_good():\n    pass\n")
    (tmp_path / "test_bad.py").write_text("def test_bad():\n    assert 'this' == 'that'\n")
    good, bad = (Group(name, (str(tmp_path / f"test_{name}.py"),)) for name in ("good", "bad"))
    alone = ["-p", "no:cacheprovider", "-c", "/dev/null", "--rootdir", str(tmp_path)]
    assert run.run((good,), alone) == 0
    assert "good passed" in capsys.readouterr().out
    assert run.run((good, bad), alone) == 1
    said = capsys.readouterr().out
    assert "assert 'this' == 'that'" in said
    assert "bad failed" in said
    assert "good passed" in said
    assert run.run((good,), [*alone, "-k", "elsewhere"]) == 0  # the selection is of other groups


def test_a_group_without_tests_fails_where_all_were_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LOGS", tmp_path / "logs")
    (tmp_path / "test_none.py").write_text("")
    assert run.run((Group("none", (str(tmp_path / "test_none.py"),)),), []) == 1
