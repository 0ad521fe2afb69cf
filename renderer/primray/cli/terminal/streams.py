"""Standard streams that never break a command: closed ones, readers that went away, full disks, encodings that lack a letter.

What cannot be written is dropped from then on. A reader that has seen enough (`| head`) changes no exit code; that standard
output could not be written for another reason is told, and is exit code 1 if the command went well otherwise.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any, TextIO

WRITE_FAILED = 1  # the exit code


class LastingStream(io.TextIOWrapper):
    """A text stream over a file's buffer; after the first failure, what is written goes nowhere."""

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
            super().flush()  # what is left in the buffer, to nowhere

    def _give_up(self, error: OSError) -> None:
        self.failure = self.failure or error
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.fileno())
        os.close(nowhere)


def make_lasting() -> None:
    """Let the process's streams last. Letters that they cannot encode are written as escapes."""
    _open_closed()
    sys.stdout = _lasting(sys.stdout, 1)
    sys.stderr = _lasting(sys.stderr, 2)


def finish(exit_code: int) -> int:
    """Write what is left; the exit code that the command ends with."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    failure = getattr(sys.stdout, "failure", None)
    if failure is None or isinstance(failure, BrokenPipeError):
        return exit_code
    print(f"error: write-failed: standard output cannot be written: {failure.strerror}", file=sys.stderr, flush=True)
    return exit_code or WRITE_FAILED


def _open_closed() -> None:
    """A descriptor from 0 to 2 that the caller closed would be the next file's that is opened."""
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if descriptor == 0 else os.O_WRONLY)  # the lowest free one is this one


def _lasting(stream: TextIO | None, descriptor: int) -> Any:
    if stream is None:  # it was closed when Python started
        raw: Any = os.fdopen(descriptor, "wb", closefd=False)
        return LastingStream(raw, encoding="utf-8", errors="backslashreplace")
    if not isinstance(stream, io.TextIOWrapper):  # somebody's own, such as a test's
        return stream
    stream.flush()
    return LastingStream(
        stream.buffer,
        encoding=stream.encoding,
        errors="backslashreplace",
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
