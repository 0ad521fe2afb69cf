"""Standard streams that never break a command: closed streams, broken pipes, full disks, unencodable characters.

After a failure, further output is dropped. A broken pipe (`| head`) does not change the exit code; any other failure of
standard output is reported, with exit code 1 if the command succeeded otherwise.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any, TextIO

WRITE_FAILED = 1  # the exit code


class LastingStream(io.TextIOWrapper):
    """A text stream over a file's buffer that drops output after the first failure."""

    failure: OSError | None = None

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except OSError as error:
            self._give_up(error)
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            self._give_up(error)
            super().flush()  # discard the rest of the buffer

    def _give_up(self, error: OSError) -> None:
        self.failure = self.failure or error
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.fileno())
        os.close(nowhere)


def make_lasting() -> None:
    """Replace the standard streams with lasting ones. Characters that they cannot encode are written as escapes."""
    _open_closed()
    sys.stdout = _lasting(sys.stdout, 1)
    sys.stderr = _lasting(sys.stderr, 2)


def finish(exit_code: int) -> int:
    """Flush the streams; return the exit code of the command."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    failure = getattr(sys.stdout, "failure", None)
    if failure is None or isinstance(failure, BrokenPipeError):
        return exit_code
    print(f"error: write-failed: standard output cannot be written: {failure.strerror}", file=sys.stderr, flush=True)
    return exit_code or WRITE_FAILED


def _open_closed() -> None:
    """Reopen closed descriptors 0 to 2, which would otherwise be given to the next file that is opened."""
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if descriptor == 0 else os.O_WRONLY)  # gets the lowest free number, this one


def _lasting(stream: TextIO | None, descriptor: int) -> Any:
    if stream is None:  # it was closed when Python started
        raw: Any = os.fdopen(descriptor, "wb", closefd=False)
        return LastingStream(raw, encoding="utf-8", errors="backslashreplace")
    if not isinstance(stream, io.TextIOWrapper):  # replaced by the caller, such as a test
        return stream
    stream.flush()
    return LastingStream(
        stream.buffer,
        encoding=stream.encoding,
        errors="backslashreplace",
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
