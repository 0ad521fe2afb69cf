"""Progress output of a render: a bar on a terminal, JSON lines if requested, else nothing."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ...render.speed import Speed, rate_text
from ..json_lines import print_line

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
