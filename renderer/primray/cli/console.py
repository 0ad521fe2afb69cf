"""Console output: JSON lines, errors, progress, and standard streams that survive failures.

`--json` prints one JSON object per line on stdout, each with a "type" (progress, report, scene, error). The standard streams
never break a command: closed streams, broken pipes, full disks, unencodable characters. After a failure, further output is
dropped. A broken pipe (`| head`) does not change the exit code; any other failure of standard output is reported, with exit
code 1 if the command succeeded otherwise.
"""

from __future__ import annotations

import io
import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TextIO

from ..errors import InternalError, PrimrayError, UnsupportedError
from ..render.progress import Speed, rate_text


def print_line(line: Mapping[str, Any]) -> None:
    print(dumps(line, ascii=not _is_unicode(sys.stdout)), flush=True)


def dumps(value: Any, *, indent: int | None = None, ascii: bool = False) -> str:
    """Return strict JSON, with null for numbers that are not finite.

    Bytes of a file name that are not UTF-8 are escaped, and with `ascii` every character beyond ASCII.
    """
    text = json.dumps(_finite(value), indent=indent, ensure_ascii=ascii, allow_nan=False)
    return text.encode("utf-8", "backslashreplace").decode()  # lone surrogates become \udcxx, which is valid JSON


def _is_unicode(stream: Any) -> bool:
    return str(getattr(stream, "encoding", None) or "utf-8").lower().replace("-", "").startswith("utf")


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


_MOST_LINES = 40  # lines of refused diagnostics


def print_error(error: Exception, as_json: bool) -> int:
    """Print an error, preceded by the diagnostics that it refuses if there are several; return its exit code."""
    if isinstance(error, UnsupportedError) and len(error.refused) > 1:
        from ..diagnostic_messages import diagnostics_lines

        lines = diagnostics_lines(error.refused, verbose=True)
        more = [f"and {len(lines) - _MOST_LINES:,} more lines"] if len(lines) > _MOST_LINES else []
        print(*lines[:_MOST_LINES], *more, sep="\n", file=sys.stderr)
    print(f"error: {error}", file=sys.stderr)
    return print_json_error(error) if as_json else exit_code_of(error)


def print_json_error(error: Exception) -> int:
    known = error if isinstance(error, PrimrayError) else InternalError(str(error))
    code, message, where = known.code, known.message, known.where
    print_line({"type": "error", "code": code, "message": message, "where": where, "exit_code": exit_code_of(error)})
    return exit_code_of(error)


def exit_code_of(error: Exception) -> int:
    return error.exit_code if isinstance(error, PrimrayError) else 1


Show = Callable[[float, int, int], None]

_JSON_INTERVAL_S = 0.5


@contextmanager
def showing(what: str, as_json: bool) -> Iterator[Show]:
    """Yield a function to call with (fraction, samples, rays) while rendering `what`."""
    if as_json:
        yield _json_lines(what)
    elif sys.stderr.isatty():
        with _bar(what) as show:
            yield show
    else:
        yield lambda fraction, samples, rays: None


def _json_lines(what: str) -> Show:
    speed = Speed()
    next_time = 0.0

    def show(fraction: float, samples: int, rays: int) -> None:
        nonlocal next_time
        now = time.monotonic()
        figures = speed(fraction, samples, rays)
        if now < next_time and fraction < 1:
            return
        next_time = now + _JSON_INTERVAL_S
        line = {"type": "progress", "output": what, "fraction": fraction, "samples": samples, "rays": rays}
        print_line(line | figures)

    return show


@contextmanager
def _bar(what: str) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[rate]}", markup=False),
        TimeElapsedColumn(),
    )
    speed = Speed()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=1.0, rate="")

        def show(fraction: float, samples: int, rays: int) -> None:
            figures = speed(fraction, samples, rays)
            progress.update(task, completed=fraction, rate=f"{rate_text(figures)} elapsed")

        yield show


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
