"""Time spans and counters of what is being traced: `span` marks what is worth a row, and costs a comparison where nothing
records. `primray.report.profile` starts and ends recordings, and writes them.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from math import isfinite
from typing import Any, NamedTuple

from . import process_memory


class Span(NamedTuple):
    """What one thread did from `begin_ns` to `end_ns`, in nanoseconds of time.monotonic_ns()."""

    name: str
    thread: int  # the operating system's identifier
    begin_ns: int
    end_ns: int
    facts: Mapping[str, Any]


class Recorder:
    """The spans and counters of one trace; `thread` is the one that records."""

    def __init__(self, begin_ns: int) -> None:
        self.begin_ns = begin_ns
        self.thread = threading.get_native_id()
        self.spans: list[Span] = []
        self.counters: list[tuple[int, str, float]] = []  # time, name and value

    @contextmanager
    def span(self, name: str, facts: Mapping[str, Any]) -> Iterator[None]:
        begin = time.monotonic_ns()
        try:
            yield
        finally:
            self.add(name, begin, time.monotonic_ns(), facts)
            self.count("memory MB", process_memory.resident_bytes() / 1e6)

    def add(self, name: str, begin_ns: int, end_ns: int, facts: Mapping[str, Any]) -> None:
        self.spans.append(Span(name, threading.get_native_id(), begin_ns, end_ns, facts))

    def count(self, name: str, value: float) -> None:
        if isfinite(value):
            self.counters.append((time.monotonic_ns(), name, value))


_recorder: Recorder | None = None


def record(recorder: Recorder | None) -> None:
    """Record into `recorder` from now on; None: nowhere."""
    global _recorder
    _recorder = recorder


def is_recording() -> bool:
    """Return whether a trace is being recorded."""
    return _recorder is not None


def span(name: str, **facts: Any) -> AbstractContextManager[None]:
    """Return a context whose time is a span of the trace that is being recorded, if one is; `facts` are shown with it."""
    return nullcontext() if _recorder is None else _recorder.span(name, facts)


def count(name: str, value: Callable[[], float]) -> None:
    """Record a counter's value, which is asked for only where a trace is recorded."""
    if _recorder is not None:
        _recorder.count(name, value())
