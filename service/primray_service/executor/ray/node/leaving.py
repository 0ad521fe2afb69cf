"""Files of a worker on their way back: read here, by a process that has not seen a scene, and then removed from the worker's
folder."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from .content import PART_BYTES
from .items import FileEnd, Part


def files_of(message: Mapping[str, Any]) -> list[str]:
    """Return the files that a message names."""
    if message["at"] in ("preview", "checkpoint"):
        return [message["file"]]
    return [output["file"] for output in message["outputs"]] if message["at"] == "done" else []


def taken(folder: Path, name: str, most_bytes: int) -> Iterator[Part | FileEnd]:
    """Yield the file's blocks; nothing unless it is a plain file of at most `most_bytes`: its adoption then fails with a
    report."""
    try:
        handle = os.open(folder / name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode) or found.st_nlink != 1 or found.st_size > most_bytes:
            return
        sha256, left = hashlib.sha256(), found.st_size  # bytes appended meanwhile are not taken
        while left > 0 and (data := file.read(min(left, PART_BYTES))):
            left -= len(data)
            sha256.update(data)
            yield Part(name, data)
        if not found.st_size:
            yield Part(name, b"")
    with suppress(OSError):
        os.unlink(folder / name)
    yield FileEnd(name, sha256.hexdigest())
