"""Progress of a render: its speed and remaining time, a bar in notebooks, and snapshots of the unfinished picture.

The notebook's bar is an output that is cleared at the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ..diagnostic_messages import Html, bar_html, display, in_notebook
from ..errors import SettingsError

if TYPE_CHECKING:
    from ..images.image import Image
    from ..report.prepared import Prepared
    from ..sampling.sampling import Progress, Sampling


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


@dataclass(frozen=True)
class Snapshots:
    """Calls `take` with the picture so far every `every_s` seconds, while sampling pauses; it has no AOVs and no report."""

    every_s: float
    take: Callable[[Image], None]
    most_share: float = 1.0  # largest share of the time that snapshots may take; slower ones are taken less often

    def __post_init__(self) -> None:
        if not (math.isfinite(self.every_s) and self.every_s > 0):
            raise SettingsError(f"the interval of snapshots must be a number of seconds above 0, not {self.every_s}")

    def of(self, prepared: Prepared) -> FrameSnapshots:
        """Return the snapshots of one frame; the first is due after one interval."""
        return FrameSnapshots(self, prepared)


class FrameSnapshots:
    """Snapshots of one frame, a `sampling.pauses.Saving`."""

    def __init__(self, snapshots: Snapshots, prepared: Prepared) -> None:
        self._snapshots = snapshots
        self._prepared = prepared
        self._next = time.monotonic() + snapshots.every_s

    def is_due(self) -> bool:
        return time.monotonic() >= self._next

    def save_meanwhile(self, sampling: Sampling) -> None:
        start = time.monotonic()
        self._snapshots.take(picture_so_far(self._prepared, sampling))
        now = time.monotonic()
        self._next = now + max(self._snapshots.every_s, (now - start) * (1 / self._snapshots.most_share - 1))


def picture_so_far(prepared: Prepared, sampling: Sampling) -> Image:
    """Return the picture without AOVs and report; pixels without samples are black."""
    from ..description.picture_file import PLAIN
    from ..images.image import Image

    pixels, errors = sampling.film.image()
    low, high = sampling.film.samples_per_pixel
    metadata: dict[str, str | int | float] = {
        "unfinished": 1,
        "samples": sampling.film.samples,
        "samples_per_pixel": f"{low} {high}",
    }
    space = prepared.scene.rendering_space
    return Image(
        pixels,
        {},
        metadata,
        prepared.camera,
        errors=errors,
        frame=prepared.frame,
        color_space=space,
        file=prepared.file or PLAIN,
    )
