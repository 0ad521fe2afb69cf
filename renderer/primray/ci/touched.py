"""The stages that a change reaches, by what their layers name on either side."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from ..errors import SettingsError
from ..usd import files_named
from .changes import Change
from .repository import Sides

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


@dataclass(frozen=True)
class Touched:
    """A stage that a change reaches. `path` is relative to the repository."""

    path: str
    changes: tuple[Change, ...]
    files: frozenset[str]  # all that it names on either side, relative


@dataclass(frozen=True)
class Reach:
    """`unreadable`: changed layers that only the side before can parse; `unused`: changed files that no stage names."""

    stages: tuple[Touched, ...]
    left_out: int  # stages beyond the most that were asked for
    unreadable: tuple[str, ...]
    never_readable: tuple[str, ...]  # changed layers that neither side can parse
    unused: tuple[str, ...]


def reach(sides: Sides, patterns: Sequence[str], most: int) -> Reach:
    """Return the stages that are touched: those that match a pattern, or else those that no other stage names."""
    named: dict[str, set[str]] = {}
    broken_before: set[str] = set()
    broken_after: set[str] = set()
    for side in (sides.before, sides.after):
        for path in _stage_files(side, sides.ignored if side is sides.after else frozenset()):
            found, broken = files_named(str(side / path))
            named.setdefault(path, set()).update(_relative(found, side))
            (broken_after if side is sides.after else broken_before).update(_relative(broken, side))
    inner = {file for path, files in named.items() for file in files - {path}}
    for each in patterns:
        if not any(fnmatch(path, each) for path in named):
            raise SettingsError(f"no stage of either side matches {each!r}; paths are from the repository's root", code="usage")
    roots = [p for p in sorted(named) if any(fnmatch(p, each) for each in patterns)] if patterns else []
    if not patterns:
        roots = [path for path in sorted(named) if path not in inner]
    touched = []
    for path in roots:
        folders = {each for each in sides.submodules.absent if _names_below(named[path], each)}
        met = tuple(change for change in sides.changes if change.paths & (named[path] | folders))
        if met:
            touched.append(Touched(path, met, frozenset(named[path])))
    unreadable = [change for change in sides.changes if change.after in broken_after]
    never = [change for change in unreadable if change.before in broken_before]
    changed = {path for change in sides.changes for path in change.paths}
    used = {path for stage in touched for path in stage.files} | sides.submodules.absent.keys()
    return Reach(
        tuple(touched[:most]),
        max(0, len(touched) - most),
        tuple(sorted(str(change.after) for change in unreadable if change not in never)),
        tuple(sorted(str(change.after) for change in never)),
        tuple(sorted(changed - used)),
    )


def _names_below(files: set[str] | frozenset[str], folder: str) -> bool:
    return any(file.startswith(f"{folder}/") for file in files)


def absent_submodules(touched: Touched, sides: Sides) -> list[str]:
    """Return the submodules that a stage names a file of, and whose files are missing on a side."""
    return [path for path in sides.submodules.absent if _names_below(touched.files, path)]


def _stage_files(side: Path, ignored: frozenset[str]) -> list[str]:
    """Return the stages of a side; a copy that git ignores, of a build or an environment, is none of them."""
    found = []
    for folder, folders, names in os.walk(side):
        below = os.path.relpath(folder, side)
        folders[:] = sorted(name for name in folders if not name.startswith(".") and _path(below, name) not in ignored)
        found += [_path(below, name) for name in names if name.lower().endswith(USD_SUFFIXES)]
    return sorted(path for path in found if path not in ignored)


def _path(folder: str, name: str) -> str:
    return os.path.normpath(os.path.join(folder, name))


def _relative(files: set[str], side: Path) -> set[str]:
    """Return files below a side, and the links that lead to them: a link that is set elsewhere is a change, too."""
    root = os.path.realpath(side)
    found = {step for file in files for step in _steps(os.path.abspath(file))}
    return {os.path.relpath(file, root) for file in found if file.startswith(root + os.sep)}


MOST_LINKS = 40  # on the way to a file, as of Linux


def _steps(path: str) -> Iterator[str]:
    """Yield each link on the way to a file, and the file's real path."""
    at, names, links = os.sep, path.split(os.sep), 0
    while names:
        name = names.pop(0)
        here = os.path.dirname(at) if name == os.pardir else at if name in ("", os.curdir) else os.path.join(at, name)
        if links < MOST_LINKS and os.path.islink(here):
            links += 1
            yield here
            target = os.readlink(here)
            names[:0] = target.split(os.sep)
            at = os.sep if os.path.isabs(target) else at
        else:
            at = here
    yield at
