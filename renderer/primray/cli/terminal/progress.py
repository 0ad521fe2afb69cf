"""How a render's progress is shown: a bar on a terminal, JSON lines where asked for, else nothing."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..json_lines import print_line

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


class _Speed:
    """Rates and time left, counted from the first call: what went before is not rendering."""

    def __init__(self) -> None:
        self.start: tuple[float, float, int, int] | None = None

    def __call__(self, fraction: float, samples: int, rays: int) -> dict[str, float | None]:
        now = time.monotonic()
        if self.start is None:
            self.start = (now, fraction, samples, rays)
        elapsed, done = now - self.start[0], fraction - self.start[1]
        per_s = 1 / elapsed if elapsed > 0 else 0.0
        return {
            "samples_per_s": (samples - self.start[2]) * per_s,
            "rays_per_s": (rays - self.start[3]) * per_s,
            "elapsed_s": elapsed,
            "eta_s": 0.0 if fraction >= 1 else elapsed * (1 - fraction) / done if done > 0 else None,
        }


def _json_lines(what: str) -> Show:
    speed = _Speed()
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
    speed = _Speed()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=1.0, rate="")

        def show(fraction: float, samples: int, rays: int) -> None:
            figures = speed(fraction, samples, rays)
            progress.update(task, completed=fraction, rate=_rate_text(figures))

        yield show


def _rate_text(figures: dict[str, float | None]) -> str:
    samples, rays, eta = (figures[name] or 0.0 for name in ("samples_per_s", "rays_per_s", "eta_s"))
    minutes, seconds = divmod(round(eta), 60)
    left = f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}" if figures["eta_s"] is not None else "-:--:--"
    return f"{samples / 1e6:.2f} Msamples/s {rays / 1e6:.1f} Mrays/s ETA {left} elapsed"
