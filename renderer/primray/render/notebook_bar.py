"""Progress bar of a render in a notebook: one output that is updated, and cleared at the end."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

from ..messages.notebook import Html, bar_html, display, in_notebook
from .speed import Speed, rate_text

if TYPE_CHECKING:
    from ..sampling.sampling import Progress

INTERVAL_S = 0.2  # the front end redraws at each update


@contextmanager
def shown_progress(progress: Progress | Literal[False] | None) -> Iterator[Progress | None]:
    """Yield the callback that a render reports to: the caller's; None: a bar in a notebook, else nothing; False: nothing."""
    if progress is None and in_notebook():
        with _bar() as show:
            yield show
    else:
        yield progress or None


@contextmanager
def _bar() -> Iterator[Progress]:
    speed, next_time = Speed(), 0.0
    handle = display(Html(bar_html(0.0, "")), display_id=True)

    def show(fraction: float, samples: int, rays: int) -> None:
        nonlocal next_time
        figures, now = speed(fraction, samples, rays), time.monotonic()
        if now >= next_time:
            next_time = now + INTERVAL_S
            handle.update(Html(bar_html(fraction, rate_text(figures))))

    try:
        yield show
    finally:
        handle.update(Html(""))
