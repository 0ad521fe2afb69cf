"""File locks: folders and files that their owner holds; a sweep removes those that nobody holds."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable
from pathlib import Path


def make_held(make: Callable[[], tuple[Path, int]]) -> tuple[Path, int]:
    """Create a path by `make` (which returns the path and an open handle), and lock it. A sweep may remove it before it is
    locked: then another is made. `make` raises FileNotFoundError if it was removed before it was opened."""
    while True:
        try:
            path, handle = make()
        except FileNotFoundError as error:
            if error.filename is not None and not Path(error.filename).parent.is_dir():
                raise
            continue
        fcntl.flock(handle, fcntl.LOCK_EX)
        if _is_at(path, handle):
            return path, handle
        os.close(handle)


def _is_at(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(path.lstat(), os.fstat(handle))
    except FileNotFoundError:
        return False
