"""Snapshots: the unfinished picture at intervals during a render."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import SettingsError

if TYPE_CHECKING:
    from ..images.image import Image
    from ..report.prepared import Prepared
    from ..sampling.sampling import Sampling


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
