"""What a user asks of a render. Values that the scene decides are None here and resolved by translation."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Filter(Enum):
    BOX = "box"
    GAUSSIAN = "gaussian"
    BLACKMAN_HARRIS = "blackman-harris"


# Full widths in pixels: the box that is the exact pixel average, and the widths at which the others look alike.
DEFAULT_FILTER_WIDTH = {Filter.BOX: 1.0, Filter.GAUSSIAN: 3.0, Filter.BLACKMAN_HARRIS: 3.0}


@dataclass(frozen=True)
class RenderSettings:
    camera: str | None = None  # prim path, or the name of a camera if only one has it
    resolution: tuple[int, int] | None = None  # width, height; one of them 0: by the camera's aspect
    time_code: float | None = None  # None: the stage's default time
    spp: int = 64
    max_depth: int | None = None  # surface scatterings, 1 = direct light only
    filter: Filter = Filter.BLACKMAN_HARRIS
    filter_width: float | None = None
    threads: int | None = None  # None: every core this process may use
    seed: int = 0
    default_light: bool = True
    purposes: tuple[str, ...] | None = None  # None: RenderSettings' includedPurposes, else default and render
    strict: bool = False
    max_memory_bytes: int | None = None
