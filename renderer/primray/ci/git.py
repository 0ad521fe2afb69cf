"""Calls of git; what it refuses is a SettingsError with code "git".

A hook's variables name the repository and the index of the commit that is being made. Git would take these for every
repository that it is called for, and `git worktree add` would write its files into that index, so they are left out of each
call. A call that reads what is staged is given the index.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from ..errors import SettingsError

OF_A_REPOSITORY = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_COMMON_DIR", "GIT_PREFIX", "GIT_NAMESPACE")


def answers(folder: Path, *words: str) -> bool:
    return _run(folder, words, None).returncode == 0


def git(folder: Path, *words: str, index: Path | None = None) -> str:
    """Return what git prints; `index`: the file of what is staged, where that is not the repository's own."""
    try:
        done = _run(folder, words, index)
    except FileNotFoundError:
        raise SettingsError("primray ci needs git", code="git") from None
    if done.returncode != 0:
        raise SettingsError(f"git {words[0]}: {done.stderr.decode(errors='replace').strip()}", where=str(folder), code="git")
    return done.stdout.decode(errors="surrogateescape")


def empty_tree(folder: Path) -> str:
    """Return the hash of a tree without files."""
    return git(folder, "hash-object", "-t", "tree", "/dev/null").strip()


def staged_index(folder: Path) -> Path:
    """Return the index that a commit is being made of: in a hook the one that git names, which may be a temporary one."""
    named = os.environ.get("GIT_INDEX_FILE")
    if named:
        return Path(folder, named)
    return Path(git(folder, "rev-parse", "--path-format=absolute", "--git-path", "index").strip())


def _run(folder: Path, words: tuple[str, ...], index: Path | None) -> subprocess.CompletedProcess[bytes]:
    environment = {name: value for name, value in os.environ.items() if name not in OF_A_REPOSITORY}
    environment["GIT_OPTIONAL_LOCKS"] = "0"  # nothing is refreshed in an index that a commit is being made of
    if index is not None:
        environment["GIT_INDEX_FILE"] = str(index)
    return subprocess.run(["git", "-C", str(folder), *words], check=False, capture_output=True, env=environment)
