"""`make release` in a scratch repository: what it makes, and that each bad input is refused and changes nothing."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from primray import __version__

from .changelog import faults

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
VERSION_FILE = PROJECT["tool"]["scikit-build"]["metadata"]["version"]["input"]
RECIPE = "deploy/conda/recipe.yaml"
FILES = (".ci/release", "CHANGELOG.md", "pyproject.toml", VERSION_FILE, "schemas/openapi.json", RECIPE)
NEXT = f"{int(__version__.split('.')[0]) + 1}.0.0"
ENTRY = "\n### Added\n\n- Something new.\n"


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    """A repository on main with the files that a release reads, and a Makefile whose `check` passes and says that it ran."""
    root = tmp_path / "scratch"
    for name in FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    rule = re.search(r"^release:.*\n(?:\t.*\n)+", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert rule is not None
    (root / "Makefile").write_text(f"PYTHON := python3\n\ncheck:\n\t@touch out/checked\n\n{rule[0]}", encoding="utf-8")
    (root / ".gitignore").write_text("/out/\n", encoding="utf-8")
    changes = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    before, _, after = changes.partition("## Unreleased\n")
    released = after[after.index(f"## {__version__}") :]
    (root / "CHANGELOG.md").write_text(f"{before}## Unreleased\n{ENTRY}\n{released}", encoding="utf-8")
    (root / "out").mkdir()
    git(root, "init", "--quiet", "--initial-branch=main")
    git(root, "config", "user.name", "A Tester")
    git(root, "config", "user.email", "tester@example.org")
    commit(root)
    return root


def git(root: Path, *arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=root, check=True, capture_output=True, text=True).stdout.strip()


def commit(root: Path) -> None:
    git(root, "add", "--all")
    git(root, "commit", "--quiet", "--message", "Start")


def release(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", "release", *arguments], cwd=root, capture_output=True, text=True)


def refused(root: Path, *arguments: str) -> str:
    """What it says; nothing has changed."""
    before = git(root, "rev-parse", "HEAD"), git(root, "status", "--porcelain")
    ended = release(root, *arguments)
    assert ended.returncode != 0, ended.stdout
    assert (git(root, "rev-parse", "HEAD"), git(root, "status", "--porcelain")) == before
    assert not list((root / "out").glob("release-notes*"))
    return ended.stderr


def test_a_release_is_a_commit_that_can_be_tagged(scratch):
    ended = release(scratch, f"VERSION={NEXT}")
    assert ended.returncode == 0, ended.stderr
    assert (scratch / "out/checked").exists()
    assert git(scratch, "log", "-1", "--format=%s") == f"Version {NEXT}"
    assert not git(scratch, "status", "--porcelain")
    assert f'\n__version__ = "{NEXT}"\n' in (scratch / VERSION_FILE).read_text(encoding="utf-8")
    openapi = (scratch / "schemas/openapi.json").read_text(encoding="utf-8")
    assert openapi == (ROOT / "schemas/openapi.json").read_text(encoding="utf-8").replace(f'"{__version__}"', f'"{NEXT}"')
    changes = (scratch / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"## Unreleased\n\n## {re.escape(NEXT)} \(\d{{4}}-\d\d-\d\d\)\n{ENTRY}", changes)
    assert not list(faults(changes, NEXT))
    assert (scratch / f"out/release-notes-{NEXT}.md").read_text(encoding="utf-8") == ENTRY.lstrip()
    tag = re.search(r"^    (git tag .*)$", ended.stdout, re.MULTILINE)
    assert tag is not None
    assert not git(scratch, "tag")
    git(scratch, *tag[1].split()[1:])
    assert git(scratch, "tag", "--list", "--format=%(refname:short) %(contents:subject)") == f"v{NEXT} ### Added"


def test_a_candidate_comes_before_its_release(scratch):
    for version in (f"{NEXT}rc1", f"{NEXT}rc2", NEXT):
        ended = release(scratch, f"VERSION={version}")
        assert ended.returncode == 0, ended.stderr
        changes = (scratch / "CHANGELOG.md").read_text(encoding="utf-8")
        assert not list(faults(changes, version))
        (scratch / "CHANGELOG.md").write_text(changes.replace("## Unreleased\n", f"## Unreleased\n{ENTRY}"), encoding="utf-8")
        commit(scratch)
    assert "is not newer" in release(scratch, f"VERSION={NEXT}rc3").stderr


def notes(root: Path, version: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([root / ".ci/release", "--notes", version], cwd=root, capture_output=True, text=True)


def test_notes_of_a_version_are_what_the_changelog_says_of_it(scratch):
    assert release(scratch, f"VERSION={NEXT}").returncode == 0
    assert notes(scratch, NEXT).stdout == (scratch / f"out/release-notes-{NEXT}.md").read_text(encoding="utf-8")
    assert notes(scratch, __version__).stdout.strip()
    none = notes(scratch, f"{NEXT}rc1")
    assert (none.returncode, none.stdout) == (1, "")
    assert f"says nothing of {NEXT}rc1" in none.stderr


def test_what_passed_elsewhere_is_not_checked_again(scratch):
    assert release(scratch, f"VERSION={NEXT}", f"CHECKED={git(scratch, 'rev-parse', 'HEAD')}").returncode == 0
    assert not (scratch / "out/checked").exists()


@pytest.mark.parametrize(
    "version", ["", "1", "v9.0.0", "9.0", "9.0.0rc", "9.0.0rc0", "9.0.0b1", "09.0.0", __version__, "0.0.1"]
)
def test_a_version_that_is_none_or_not_newer(scratch, version):
    assert f"VERSION={version} is not" in refused(scratch, f"VERSION={version}")


def test_changes_that_are_not_committed(scratch):
    (scratch / "Makefile").open("a", encoding="utf-8").write("\n")
    assert "not committed" in refused(scratch, f"VERSION={NEXT}")


def test_files_that_git_does_not_know(scratch):
    (scratch / "new.py").touch()
    assert "does not know" in refused(scratch, f"VERSION={NEXT}")


def test_another_branch(scratch):
    git(scratch, "switch", "--quiet", "--create", "mine")
    assert "the branch is mine, not main" in refused(scratch, f"VERSION={NEXT}")


def test_a_tag_that_is_there(scratch):
    git(scratch, "tag", f"v{NEXT}")
    assert "is there already" in refused(scratch, f"VERSION={NEXT}")


@pytest.mark.parametrize(("old", "new", "why"), [(ENTRY, "\n", "nothing under"), ("## Unreleased", "## Next", "no section")])
def test_a_changelog_without_entries(scratch, old, new, why):
    text = (scratch / "CHANGELOG.md").read_text(encoding="utf-8")
    (scratch / "CHANGELOG.md").write_text(text.replace(old, new), encoding="utf-8")
    commit(scratch)
    assert why in refused(scratch, f"VERSION={NEXT}")


def test_places_of_the_version_that_disagree(scratch):
    text = (scratch / "schemas/openapi.json").read_text(encoding="utf-8")
    (scratch / "schemas/openapi.json").write_text(text.replace(f'"{__version__}"', '"0.0.0"'), encoding="utf-8")
    commit(scratch)
    assert "openapi.json does not have the version" in refused(scratch, f"VERSION={NEXT}")


def test_a_check_that_fails(scratch):
    text = (scratch / "Makefile").read_text(encoding="utf-8")
    (scratch / "Makefile").write_text(text.replace("touch out/checked", "false"), encoding="utf-8")
    commit(scratch)
    assert "make check did not pass" in refused(scratch, f"VERSION={NEXT}")


def test_a_check_of_another_commit(scratch):
    old = git(scratch, "rev-parse", "HEAD")
    (scratch / "new.py").touch()
    commit(scratch)
    assert "is not the commit" in refused(scratch, f"VERSION={NEXT}", f"CHECKED={old}")
