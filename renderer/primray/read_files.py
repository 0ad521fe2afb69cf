"""Files that a command has read, which none of its outputs may replace.

The command line watches while a command runs; nothing is watched in programs that use the library, which may write a texture
and render with it. Whatever opens a file of a stage calls `note_read`, which never raises, since many readers turn errors into
diagnostics; `check_kept` raises before the first sample. An output that does not exist yet replaces nothing and costs nothing.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from .errors import SettingsError

REPLACED = "the output would overwrite a file that the command reads: give it another name"


class _Watch:
    """Names of read files as they were opened; existing outputs by device and inode, with their path and given name; the given
    name of an output that is a read file."""

    def __init__(self) -> None:
        self.read: set[str] = set()
        self.outputs: dict[tuple[int, int], tuple[str, str]] = {}
        self.replacing: str | None = None

    def compare(self, path: str) -> None:
        found = self.outputs.get(_identity(path) or (0, 0))
        if found is not None and os.path.realpath(path) == found[0]:  # another hard link is kept when one is replaced
            self.replacing = found[1]


_watch: _Watch | None = None


@contextmanager
def watching_files() -> Iterator[None]:
    """Watch files that are read and written in the block, in any thread."""
    global _watch
    before, _watch = _watch, _Watch() if _watch is None else _watch
    try:
        yield
    finally:
        _watch = before


def is_watching() -> bool:
    return _watch is not None


def note_read(path: str) -> None:
    """Note a file that is opened, or the package of a member ("package.usdz[member]")."""
    if _watch is None:
        return
    if path.endswith("]"):
        path = path.partition("[")[0]
    _watch.read.add(path)
    if _watch.outputs:
        _watch.compare(path)


def note_output(path: str | os.PathLike[str]) -> None:
    """Note a file that is going to be written; raise SettingsError as `check_kept` does."""
    if _watch is None:
        return
    if (identity := _identity(os.fspath(path))) is not None and os.path.isfile(path):
        _watch.outputs[identity] = os.path.realpath(path), os.fspath(path)
        for read in list(_watch.read):
            _watch.compare(read)
    check_kept()


def check_kept() -> None:
    """Raise SettingsError `output-folder` if an output is a file that has been read."""
    if _watch is not None and _watch.replacing is not None:
        raise SettingsError(REPLACED, where=_watch.replacing, code="output-folder")


def _identity(path: str) -> tuple[int, int] | None:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino
