"""Folders in incoming/ for uploads under way: locked while in use, so that a dead server's can be told from a living one's."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from ..files import DataDirectory
from ..held import make_held
from .threads import to_the_end


@asynccontextmanager
async def staging(data: DataDirectory) -> AsyncIterator[Path]:
    """A new folder, gone at the end unless it was renamed."""
    folder, lock = await to_the_end(lambda: make_held(lambda: _make(data.incoming)))
    try:
        yield folder
    finally:
        await to_the_end(lambda: _discard(folder, lock))


def _make(incoming: Path) -> tuple[Path, int]:
    folder = Path(tempfile.mkdtemp(prefix="upload-", dir=incoming))
    return folder, os.open(folder, os.O_RDONLY | os.O_DIRECTORY)


def _discard(folder: Path, lock: int) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    os.close(lock)


def sweep(incoming: Path) -> int:
    """Remove what nobody holds; tells how many. For the start of a server."""
    removed = 0
    for folder in incoming.iterdir():
        try:
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        except (NotADirectoryError, FileNotFoundError):
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            continue
        _discard(folder, lock)
        removed += 1
    return removed
