"""Two sides of a git repository in folders of their own, and the files that differ between them."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import SettingsError
from .changes import Change, changes, is_of_page
from .git import answers, empty_tree, git, staged_index
from .submodules import Submodules, check_out

FETCH_ALL = "git fetch --unshallow origin '+refs/heads/*:refs/remotes/origin/*'"


@dataclass(frozen=True)
class Sides:
    """Folders with the files before and after, and what differs."""

    before: Path
    after: Path
    base: str  # the commit, or "no commit" where there is none yet
    head: str  # a commit, "staged" or "working tree"
    changes: tuple[Change, ...]
    submodules: Submodules = field(default_factory=Submodules)
    ignored: frozenset[str] = frozenset()  # files and folders of the working tree that are none of the repository


@contextmanager
def sides(folder: str | os.PathLike[str], base: str | None, head: str | None, *, staged: bool) -> Iterator[Sides]:
    """Yield both sides of the repository that holds the folder; they are gone afterwards.

    Before is the merge base of `base` and the side after: HEAD for what is staged. After is what is staged, the commit `head`,
    or the working tree with its untracked files. Before the first commit there is nothing.
    """
    root = Path(git(Path(folder), "rev-parse", "--show-toplevel").strip())
    index = staged_index(root) if staged else None
    is_first = base is None and head is None and not answers(root, "rev-parse", "--verify", "--quiet", "HEAD")
    start = None if is_first else _commit(root, head or "HEAD")
    before = start if start is None or (staged and base is None) else _merge_base(root, base or _usual_base(root), start)
    temporary = Path(tempfile.mkdtemp(prefix="primray-ci-")).resolve()
    submodules = Submodules()
    try:
        if before is not None:
            git(root, "worktree", "add", "--quiet", "--detach", str(temporary / "before"), before)
        if staged:
            git(root, "checkout-index", "--all", f"--prefix={temporary / 'after'}/", index=index)
        elif head is not None and start is not None:
            git(root, "worktree", "add", "--quiet", "--detach", str(temporary / "after"), start)
        for side in ("before", "after"):
            (temporary / side).mkdir(exist_ok=True)
        after = temporary / "after" if staged or head is not None else root
        is_working = after == root
        folders = (temporary / "before", after)
        check_out(root, folders, before, start, submodules, is_working=is_working, index=index)
        old = before or empty_tree(root)
        between = ["--cached", old] if staged else [old] if head is None or start is None else [old, start]
        files = changes(root, between, untracked=is_working, index=index)
        own = [change for change in files if not (change.paths & submodules.found or is_of_page(change, *folders))]
        name = "staged" if staged else head or "working tree"
        ignored = _ignored(root) if is_working else frozenset()
        yield Sides(*folders, before or "no commit", name, (*own, *submodules.changes), submodules, ignored)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        for repository in (root, *submodules.repositories):
            answers(repository, "worktree", "prune")


def _ignored(root: Path) -> frozenset[str]:
    """Return the files that git ignores, and the folders where it ignores all."""
    listed = git(root, "ls-files", "--others", "--ignored", "--exclude-standard", "--directory", "-z").split("\0")
    return frozenset(name.rstrip("/") for name in listed if name)


def _usual_base(root: Path) -> str:
    for name in ("origin/HEAD", "origin/main", "origin/master", "main", "master"):
        if answers(root, "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"):
            return name
    raise SettingsError(f"there is no branch main or master to compare with: name a commit{_if_shallow(root)}", code="git")


def _merge_base(root: Path, base: str, head: str) -> str:
    commit = _commit(root, base)
    if not answers(root, "merge-base", commit, head):
        raise SettingsError(f"{base} and {head[:12]} have no commit in common here{_if_shallow(root)}", code="git")
    return git(root, "merge-base", commit, head).strip()


def _commit(root: Path, name: str) -> str:
    if name.startswith("-") or not answers(root, "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"):
        raise SettingsError(f"git knows no commit {name!r} here{_if_shallow(root)}", code="git")
    return git(root, "rev-parse", "--verify", f"{name}^{{commit}}").strip()


def _if_shallow(root: Path) -> str:
    """Return how to fetch what a shallow clone lacks: all branches, as such a clone knows one alone; "" for another clone."""
    if git(root, "rev-parse", "--is-shallow-repository").strip() != "true":
        return ""
    return f"; this clone is shallow: `{FETCH_ALL}` fetches the rest (in a workflow, `fetch-depth: 0` of actions/checkout)"
