"""Submodules of a repository: their files at the commits that each side records, and what differs in them.

Files come from the objects of the submodule that are on this machine; nothing is fetched.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..errors import SettingsError
from .changes import Change, changes
from .git import answers, empty_tree, git

GITLINK = "160000"


@dataclass
class Submodules:
    """`absent`: why a submodule's files are missing on a side, and what brings them, by its path. `alike`: those of them that
    are missing on both sides, which record one commit. `repositories`: where worktrees were added."""

    found: set[str] = field(default_factory=set)
    absent: dict[str, str] = field(default_factory=dict)
    alike: set[str] = field(default_factory=set)
    changes: list[Change] = field(default_factory=list)
    repositories: list[Path] = field(default_factory=list)


@dataclass(frozen=True)
class _Level:
    """A repository with its sides. `before`, `after`: commits, None where it is not on that side; `after` of the working tree
    and of what is staged, by `index`, is unused."""

    repository: Path
    prefix: str  # path in the outermost one, with a slash at the end
    folders: tuple[Path, Path]
    before: str | None
    after: str | None
    is_working: bool = False
    index: Path | None = None


def check_out(
    root: Path,
    folders: tuple[Path, Path],
    before: str | None,
    after: str | None,
    made: Submodules,
    *,
    is_working: bool,
    index: Path | None,
) -> None:
    """Put the files of submodules into the folders of both sides, but for the working tree, which has its own."""
    _fill(_Level(root, "", folders, before, after, is_working, index), made)


def _fill(level: _Level, made: Submodules) -> None:
    was = {} if level.before is None else dict(_in_commit(level.repository, level.before))
    if level.is_working or level.index is not None:
        now = dict(_in_index(level.repository, level.index))
    else:
        now = {} if level.after is None else dict(_in_commit(level.repository, level.after))
    for path in sorted(was.keys() | now.keys()):
        old, new = was.get(path), now.get(path)
        name, folders = level.prefix + path, (level.folders[0] / path, level.folders[1] / path)
        module = _objects_of(level, path)
        reason = _why_absent(level, name, folders[1], module, old, new)
        if reason is not None:
            made.absent[name] = reason
            if old == new and not (level.is_working and (folders[1] / ".git").exists()):
                made.alike.add(name)
            continue
        assert module is not None
        made.found.add(name)
        for commit, folder in ((old, folders[0]), (None if level.is_working else new, folders[1])):
            if commit is not None:
                folder.mkdir(parents=True, exist_ok=True)
                git(module, "worktree", "add", "--quiet", "--force", "--detach", str(folder), commit)
                made.repositories.append(module)
        is_working = level.is_working and new is not None
        inner = _Level(folders[1] if is_working else module, f"{name}/", folders, old, new, is_working)
        nothing = empty_tree(module)
        between = [old or nothing] if is_working else [old or nothing, new or nothing]
        made.changes += [_below(name, change) for change in changes(inner.repository, between, untracked=is_working)]
        _fill(inner, made)
    nested = made.found | made.absent.keys()
    made.changes = [change for change in made.changes if not change.paths & nested]


def _why_absent(level: _Level, name: str, folder: Path, module: Path | None, old: str | None, new: str | None) -> str | None:
    if level.is_working and new is not None and not (folder / ".git").exists():
        return f"the submodule {name} is not checked out: `git submodule update --init -- {name}` brings its files"
    for commit in (old, None if level.is_working else new):
        if commit is None:
            continue
        if module is None:
            return f"the submodule {name} is not here: `git submodule update --init -- {name}` brings its files"
        if not answers(module, "cat-file", "-e", f"{commit}^{{commit}}"):
            fetch = f"git -C {name} fetch origin {commit}"
            return f"the submodule {name} lacks the commit {commit[:12]} that is recorded: `{fetch}` brings it"
    return None


def _objects_of(level: _Level, path: str) -> Path | None:
    """Return a folder of git that has the submodule's objects; None: it is not on this machine."""
    for folder in (level.repository / path, level.folders[1] / path):
        if (folder / ".git").exists():
            return Path(git(folder, "rev-parse", "--absolute-git-dir").strip())
    common = Path(git(level.repository, "rev-parse", "--path-format=absolute", "--git-common-dir").strip())
    for side in level.folders:
        name = _name_of(side, path)
        if name is not None and (common / "modules" / name / "HEAD").is_file():
            return common / "modules" / name
    return None


def _name_of(side: Path, path: str) -> str | None:
    """Return the name by which .gitmodules knows the submodule at a path; None too for one that leads elsewhere."""
    if not (side / ".gitmodules").is_file():
        return None
    try:
        rows = git(side, "config", "--file", ".gitmodules", "--null", "--get-regexp", r"^submodule\..*\.path$").split("\0")
    except SettingsError:
        return None
    for row in rows:
        key, _, value = row.partition("\n")
        name = key.removeprefix("submodule.").removesuffix(".path")
        if value == path and ".." not in Path(name).parts and not name.startswith("/"):
            return name
    return None


def _in_commit(repository: Path, commit: str) -> Iterator[tuple[str, str]]:
    for row in git(repository, "ls-tree", "-r", "-z", "--full-tree", commit).split("\0"):
        facts, _, path = row.partition("\t")
        if facts.startswith(GITLINK):
            yield path, facts.split()[2]


def _in_index(repository: Path, index: Path | None) -> Iterator[tuple[str, str]]:
    for row in git(repository, "ls-files", "--stage", "-z", index=index).split("\0"):
        facts, _, path = row.partition("\t")
        if facts.startswith(GITLINK):
            yield path, facts.split()[1]


def _below(name: str, change: Change) -> Change:
    before, after = (None if path is None else f"{name}/{path}" for path in (change.before, change.after))
    return replace(change, before=before, after=after)
