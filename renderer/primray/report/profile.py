"""Traces of where time goes: spans of stages, files, passes and threads, which Perfetto (https://ui.perfetto.dev) opens.

The file is in the Trace Event Format, JSON of complete events ("X") whose spans nest on each thread, counters ("C") and names
("M").
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import SettingsError
from ..time_spans import Recorder, Span, is_recording, record

MAIN_ROW = 1  # the thread that records; those of the core and of pools follow it


@contextmanager
def profile(file: str | os.PathLike[str], *, from_start: bool = False) -> Iterator[None]:
    """Record what runs inside the block, and write the trace to `file` at its end, also after an error.

    >>> with primray.profile("trace.json"):
    ...     image = primray.render("shot.usda", resolution=(32, 18), spp=2)

    Open it at https://ui.perfetto.dev: a row for each thread, a span for each stage of the set-up, each texture and cage, each
    pass, and what the core's threads do in it; counters of memory, samples and rays. Pixels do not depend on it. `from_start`:
    the trace begins with the process, so that it holds the time of Python's start and of imports.

    Raises SettingsError if the file cannot be written, which is checked before anything runs, and if a trace is being recorded
    already.
    """
    path = Path(file)
    if is_recording():
        raise SettingsError("a trace is being recorded already: profiles do not nest", code="profile")
    from ..core.native import loaded
    from ..images.output_path import check_folder

    check_folder(path)
    now = time.monotonic_ns()
    recorder = Recorder(_process_start_ns(now) if from_start else now)
    if from_start:
        recorder.add("start Python", recorder.begin_ns, now, {})
    record(recorder)
    for module in loaded():
        module.record_spans(True)
    try:
        yield
    finally:
        record(None)
        for module in loaded():
            module.record_spans(False)
            recorder.spans += [Span(name, thread, begin, end, {}) for name, thread, begin, end in module.take_spans()]
        _write(path, recorder)


def _write(path: Path, recorder: Recorder) -> None:
    import json

    from ..images.image import write_text

    try:
        write_text(path, json.dumps({"traceEvents": [*_events(recorder)], "displayTimeUnit": "ms"}, separators=(",", ":")))
    except OSError as error:
        raise SettingsError(f"the trace cannot be written: {error.strerror}", where=str(path), code="profile") from None


def _events(recorder: Recorder) -> Iterator[dict[str, Any]]:
    process, rows = os.getpid(), _rows(recorder)
    yield {"ph": "M", "name": "process_name", "pid": process, "args": {"name": "primray"}}
    for row in sorted({MAIN_ROW, *rows.values()}):
        name = "main" if row == MAIN_ROW else f"worker {row - MAIN_ROW}"
        yield {"ph": "M", "name": "thread_name", "pid": process, "tid": row, "args": {"name": name}}
    for each in sorted(recorder.spans, key=lambda each: (each.begin_ns, -each.end_ns)):
        shown = {"args": dict(each.facts)} if each.facts else {}
        times = {"ts": (each.begin_ns - recorder.begin_ns) / 1e3, "dur": (each.end_ns - each.begin_ns) / 1e3}
        yield {"ph": "X", "name": each.name, "pid": process, "tid": rows[each.thread], **times, **shown}
    for at_ns, name, value in recorder.counters:
        yield {"ph": "C", "name": name, "pid": process, "ts": (at_ns - recorder.begin_ns) / 1e3, "args": {"value": value}}


def _rows(recorder: Recorder) -> dict[int, int]:
    """Return the row of each thread. Threads that live one after the other share one: each pass starts threads of its own."""
    lives: dict[int, tuple[int, int]] = {}
    for each in recorder.spans:
        begin, end = lives.get(each.thread, (each.begin_ns, each.end_ns))
        lives[each.thread] = min(begin, each.begin_ns), max(end, each.end_ns)
    rows, free_from = {recorder.thread: MAIN_ROW}, list[int]()
    others: Iterable[tuple[int, tuple[int, int]]] = sorted(lives.items(), key=lambda item: item[1])
    for thread, (begin, end) in others:
        if thread in rows:
            continue
        row = next((i for i, free in enumerate(free_from) if free <= begin), len(free_from))
        free_from[row : row + 1] = [end]
        rows[thread] = MAIN_ROW + 1 + row
    return rows


def _process_start_ns(now_ns: int) -> int:
    """Return when the process was started, to the ten milliseconds of proc(5); now, where there is none."""
    try:
        with open("/proc/self/stat", encoding="utf-8", errors="replace") as file:
            ticks = int(file.read().rpartition(")")[2].split()[19])
        age_s = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return now_ns
    return now_ns - max(int(age_s * 1e9), 0)
