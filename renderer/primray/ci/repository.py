"""Two sides of a git repository in folders of their own, and the files that differ between them."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ..errors import SettingsError

FETCH_ALL = "git fetch --unshallow origin '+refs/heads/*:refs/remotes/origin/*'"


@dataclass(frozen=True)
class Change:
    """A file that differs; paths are relative to the repository. `before` is None for a new file, `after` for a deleted one."""

    before: str | None
    after: str | None

    @property
    def name(self) -> str:
        if self.before is None:
            return f"{self.after} (new)"
        if self.after is None:
            return f"{self.before} (deleted)"
        return self.after if self.after == self.before else f"{self.before} -> {self.after}"

    @property
    def paths(self) -> set[str]:
        return {path for path in (self.before, self.after) if path is not None}


@dataclass(frozen=True)
class Sides:
    """Folders with the files before and after, and what differs."""

    before: Path
    after: Path
    base: str  # the commit
    head: str  # a commit, "staged" or "working tree"
    changes: tuple[Change, ...]


@contextmanager
def sides(folder: str | os.PathLike[str], base: str | None, head: str | None, *, staged: bool) -> Iterator[Sides]:
    """Yield both sides of the repository that holds the folder; they are gone afterwards.

    Before is the merge base of `base` and the side after: HEAD for what is staged. After is what is staged, the commit `head`,
    or the working tree with its untracked files.
    """
    root = Path(_git(Path(folder), "rev-parse", "--show-toplevel").strip())
    start = _commit(root, head or "HEAD")
    before = start if staged and base is None else _merge_base(root, base or _usual_base(root), start)
    temporary = Path(tempfile.mkdtemp(prefix="primray-ci-")).resolve()
    try:
        _git(root, "worktree", "add", "--quiet", "--detach", str(temporary / "before"), before)
        if staged:
            _git(root, "checkout-index", "--all", f"--prefix={temporary / 'after'}/")
        elif head is not None:
            _git(root, "worktree", "add", "--quiet", "--detach", str(temporary / "after"), start)
        (temporary / "after").mkdir(exist_ok=True)
        after = temporary / "after" if staged or head is not None else root
        changes = tuple(_changes(root, before, start if head is not None else None, staged=staged))
        yield Sides(temporary / "before", after, before, "staged" if staged else head or "working tree", changes)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        subprocess.run(["git", "-C", str(root), "worktree", "prune"], check=False, capture_output=True)


def _changes(root: Path, before: str, head: str | None, *, staged: bool) -> Iterator[Change]:
    between = ["--cached", before] if staged else [before] if head is None else [before, head]
    words = iter(_git(root, "diff", "--name-status", "-z", "--find-renames", "--no-ext-diff", *between).split("\0"))
    for status in words:
        if not status:
            break
        name = next(words)
        if status[0] in "RC":
            new = next(words)
            yield Change(name if status[0] == "R" else None, new)
        else:
            yield Change(None if status[0] == "A" else name, None if status[0] == "D" else name)
    if head is None and not staged:
        for name in _git(root, "ls-files", "--others", "--exclude-standard", "-z").split("\0"):
            if name:
                yield Change(None, name)


def _usual_base(root: Path) -> str:
    for name in ("origin/HEAD", "origin/main", "origin/master", "main", "master"):
        if _answers(root, "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"):
            return name
    raise SettingsError(f"there is no branch main or master to compare with: name a commit{_if_shallow(root)}", code="git")


def _merge_base(root: Path, base: str, head: str) -> str:
    commit = _commit(root, base)
    if not _answers(root, "merge-base", commit, head):
        raise SettingsError(f"{base} and {head[:12]} have no commit in common here{_if_shallow(root)}", code="git")
    return _git(root, "merge-base", commit, head).strip()


def _commit(root: Path, name: str) -> str:
    if name.startswith("-") or not _answers(root, "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"):
        raise SettingsError(f"git knows no commit {name!r} here{_if_shallow(root)}", code="git")
    return _git(root, "rev-parse", "--verify", f"{name}^{{commit}}").strip()


def _if_shallow(root: Path) -> str:
    """Return how to fetch what a shallow clone lacks: all branches, as such a clone knows one alone; "" for another clone."""
    if _git(root, "rev-parse", "--is-shallow-repository").strip() != "true":
        return ""
    return f"; this clone is shallow: `{FETCH_ALL}` fetches the rest (in a workflow, `fetch-depth: 0` of actions/checkout)"


def _answers(root: Path, *words: str) -> bool:
    return subprocess.run(["git", "-C", str(root), *words], check=False, capture_output=True).returncode == 0


def _git(root: Path, *words: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(root), *words], check=False, capture_output=True)
    except FileNotFoundError:
        raise SettingsError("primray ci needs git", code="git") from None
    if done.returncode != 0:
        raise SettingsError(f"git {words[0]}: {done.stderr.decode(errors='replace').strip()}", where=str(root), code="git")
    return done.stdout.decode(errors="surrogateescape")
