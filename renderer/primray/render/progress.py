"""Progress of a render: its speed and remaining time, and a bar in notebooks, an output that is cleared at the end."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

from ..messages.notebook import Html, bar_html, display, in_notebook

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


class Speed:
    """Rates and remaining time, counted from the first call: earlier time is not rendering."""

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


def rate_text(figures: dict[str, float | None]) -> str:
    samples, rays, eta = (figures[name] or 0.0 for name in ("samples_per_s", "rays_per_s", "eta_s"))
    minutes, seconds = divmod(round(eta), 60)
    left = f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}" if figures["eta_s"] is not None else "-:--:--"
    return f"{samples / 1e6:.2f} Msamples/s {rays / 1e6:.1f} Mrays/s ETA {left}"
