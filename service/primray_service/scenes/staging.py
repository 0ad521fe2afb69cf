"""Folders in incoming/ for uploads in progress, and blocking work that is always waited for.

Each folder has a lock beside it that is held while it is in use: so those of a dead server can be distinguished from a living
one's. The locks are of files that are open for writing: where the data directory is mounted by several machines (NFS), no other
lock is seen by all of them.
"""

from __future__ import annotations

import asyncio
import fcntl
import os
import secrets
import shutil
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import TypeVar

from ..files import DataDirectory, make_held

T = TypeVar("T")


async def to_the_end(function: Callable[[], T]) -> T:
    """Run a function like asyncio.to_thread, but wait for the thread even if cancelled, and only then propagate the
    cancellation."""
    running = asyncio.ensure_future(asyncio.to_thread(function))
    cancelled: asyncio.CancelledError | None = None
    while not running.done():
        try:
            await asyncio.wait([running])
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        running.exception()  # retrieved, so that it is not reported as lost
        raise cancelled
    return running.result()


LOCK = ".lock"


@asynccontextmanager
async def staging(data: DataDirectory) -> AsyncIterator[Path]:
    """Provide a new folder, which is removed at the end unless it was renamed."""
    folder, lock = await to_the_end(lambda: _made(data.incoming))
    try:
        yield folder
    finally:
        await to_the_end(lambda: _discard(folder, lock))


@contextmanager
def staging_here(data: DataDirectory) -> Iterator[Path]:
    """Provide a folder like `staging`, in this thread."""
    folder, lock = _made(data.incoming)
    try:
        yield folder
    finally:
        _discard(folder, lock)


def _made(incoming: Path) -> tuple[Path, int]:
    lock, handle = make_held(lambda: _make_lock(incoming))
    folder = lock.with_suffix("")
    folder.mkdir(mode=0o700)
    return folder, handle


def _make_lock(incoming: Path) -> tuple[Path, int]:
    path = incoming / f"upload-{secrets.token_hex(8)}{LOCK}"
    return path, os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


def _discard(folder: Path, lock: int) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.with_name(f"{folder.name}{LOCK}").unlink(missing_ok=True)
    os.close(lock)


def sweep(incoming: Path) -> int:
    """Remove folders that nobody holds, and return their number; for the start of a server."""
    removed = 0
    for path in incoming.iterdir():
        if path.suffix == LOCK:
            removed += _removed_if_dead(path)
        elif not path.with_name(f"{path.name}{LOCK}").exists():  # set aside by a server that died then
            shutil.rmtree(path, ignore_errors=True)
            removed += 1
    return removed


def _removed_if_dead(path: Path) -> bool:
    try:
        lock = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return False  # its server lives
    _discard(path.with_suffix(""), lock)
    return True
