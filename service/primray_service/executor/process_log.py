"""Log of a worker's output, in a file that the worker cannot write to: beginning and end if it exceeds the limit."""

from __future__ import annotations

from pathlib import Path

TAIL_BYTES = 8192


class ProcessLog:
    """Log with at most `most_bytes` in its file."""

    def __init__(self, path: Path, most_bytes: int) -> None:
        self.path = path
        self._file = open(path, "xb", buffering=0)  # noqa: SIM115 - open as long as the process
        self._most = max(most_bytes - TAIL_BYTES - 200, 0)
        self.begin()

    def begin(self) -> None:
        """Discard the content so far."""
        self._file.seek(0)
        self._file.truncate()
        self._left = self._most
        self._omitted = 0
        self._tail = bytearray()

    def add(self, data: bytes) -> None:
        kept, rest = data[: self._left], data[self._left :]
        if kept:
            self._left -= len(kept)
            self._file.write(kept)
        self._omitted += len(rest)
        self._tail += data
        del self._tail[:-TAIL_BYTES]

    def tail(self) -> str:
        return self._tail.decode("utf-8", "replace")

    def close(self) -> None:
        if self._omitted:
            end = self._tail[-min(self._omitted, TAIL_BYTES) :]
            more = self._omitted - len(end)
            self._file.write(b"\n[%d bytes are left out here]\n" % more + end if more else end)
            self._omitted = 0
        self._file.close()
