"""Local cache of a shared object store: copies of scenes and of jobs' files, removed after a day without use, and sooner, least
recently used first, if the disk is short."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

from ..files import DataDirectory
from .preparing import locked, set_aside

KEPT_S = 24 * 3600.0
USED_S = 600.0  # files used within this time may be in use
EVERY_S = 60.0


def evict(data: DataDirectory, wanted_bytes: int) -> int:
    """Evict copies, and return their number. Blocks."""
    now, removed = time.time(), 0
    for used_at, folder in sorted(_copies(data)):
        is_old = now - used_at > KEPT_S
        if not is_old and (now - used_at < USED_S or data.free_bytes() >= wanted_bytes):
            return removed
        _remove(folder, data)
        removed += 1
    return removed


def _copies(data: DataDirectory) -> Iterator[tuple[float, Path]]:
    """Yield the copies with the time of their last use."""
    for folder in data.scenes.iterdir():
        yield folder.stat().st_mtime, folder
    for path in data.contents.glob("*/*"):
        yield path.stat().st_mtime, path
    for folder in data.jobs.iterdir():
        yield max(path.stat().st_mtime for path in (folder, *folder.glob("frames/*"))), folder


def _remove(folder: Path, data: DataDirectory) -> None:
    if folder.parent.parent == data.contents:
        folder.unlink(missing_ok=True)  # packages that contain it keep their links
        return
    if folder.parent == data.jobs:
        shutil.rmtree(folder, ignore_errors=True)
        return
    with locked(data):
        gone = set_aside(f"sha256:{folder.name}", data)
    if gone is not None:
        shutil.rmtree(gone, ignore_errors=True)
