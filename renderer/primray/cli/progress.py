"""How a render's progress is shown: a bar on a terminal, JSON lines where asked for, else nothing."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .json_lines import print_line

Show = Callable[[float, int, int], None]

_JSON_INTERVAL_S = 0.5


@contextmanager
def showing(what: str, as_json: bool) -> Iterator[Show]:
    """A function to call with (fraction, samples, rays) while rendering `what`."""
    if as_json:
        yield _json_lines(what)
    elif sys.stderr.isatty():
        with _bar(what) as show:
            yield show
    else:
        yield lambda fraction, samples, rays: None


def _json_lines(what: str) -> Show:
    start = time.monotonic()
    next_time = start

    def show(fraction: float, samples: int, rays: int) -> None:
        nonlocal next_time
        now = time.monotonic()
        if now < next_time and fraction < 1:
            return
        next_time = now + _JSON_INTERVAL_S
        elapsed = now - start
        print_line(
            {
                "type": "progress",
                "output": what,
                "fraction": fraction,
                "samples": samples,
                "rays": rays,
                "rays_per_s": rays / elapsed if elapsed > 0 else 0.0,
                "elapsed_s": elapsed,
                "eta_s": elapsed * (1 - fraction) / fraction if fraction > 0 else None,
            }
        )

    return show


@contextmanager
def _bar(what: str) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("ETA"),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    start = time.monotonic()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=1.0, rate="")

        def show(fraction: float, samples: int, rays: int) -> None:
            elapsed = max(time.monotonic() - start, 1e-6)
            rate = f"{samples / elapsed / 1e6:.2f} Msamples/s, {rays / elapsed / 1e6:.1f} Mrays/s"
            progress.update(task, completed=fraction, rate=rate)

        yield show
