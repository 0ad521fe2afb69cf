"""Detection of changed files by polling: that works on every file system, and for files that do not exist yet."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Collection

LOOK_EVERY_S = 0.25

Stamp = tuple[int, int, int] | None  # time of modification (ns), size, inode; None: no such file


class FileWatch:
    """Calls `changed` with files that differ from when they were first checked, or last reported.

    A file is reported once it has stayed the same between two polls: a writer may still have been busy.
    """

    def __init__(self, changed: Callable[[set[str]], None], every_s: float = LOOK_EVERY_S) -> None:
        self._changed = changed
        self._every_s = every_s
        self._lock = threading.Lock()
        self._stamps: dict[str, Stamp] = {}
        self._unsettled: dict[str, Stamp] = {}
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="files", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._closed.set()
        self._thread.join()

    def watch(self, files: Collection[str], since_ns: int) -> None:
        """Watch these files from now on, which were read at `since_ns`: newer ones have changed. Known states are kept."""
        with self._lock:
            self._stamps = {file: self._stamps.get(file, _seen_at(file, since_ns)) for file in files}

    def look(self) -> set[str]:
        """Return files that have changed and are stable again."""
        with self._lock:
            now = {file: stamp_of(file) for file in self._stamps}
            differing = {file: stamp for file, stamp in now.items() if stamp != self._stamps[file]}
            settled = {file for file, stamp in differing.items() if self._unsettled.get(file, ()) == stamp}
            self._unsettled = {file: stamp for file, stamp in differing.items() if file not in settled}
            self._stamps.update({file: now[file] for file in settled})
        return settled

    def _run(self) -> None:
        while not self._closed.wait(self._every_s):
            if found := self.look():
                self._changed(found)


def _seen_at(file: str, time_ns: int) -> Stamp:
    stamp = stamp_of(file)
    return None if stamp is not None and stamp[0] > time_ns else stamp


def stamp_of(file: str) -> Stamp:
    try:
        found = os.stat(file)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
