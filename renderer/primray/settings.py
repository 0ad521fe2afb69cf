"""What a user asks of a render, checked when made. Values that the scene decides are None here and resolved by translation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from .aov_names import check_names
from .composition import Composition
from .errors import LimitError, SettingsError


class Filter(Enum):
    BOX = "box"
    GAUSSIAN = "gaussian"
    BLACKMAN_HARRIS = "blackman-harris"


class Metric(Enum):
    """Measures of a picture's error; error.py defines them."""

    RELMSE = "relmse"
    RMSE = "rmse"
    DISPLAY = "display"


# Full widths in pixels: the box that is the exact pixel average, and the widths at which the others look alike.
DEFAULT_FILTER_WIDTH = {Filter.BOX: 1.0, Filter.GAUSSIAN: 3.0, Filter.BLACKMAN_HARRIS: 3.0}


# Pixels that an edge of a diced subdivision surface may cover.
DEFAULT_DICING_RATE = 4.0

PURPOSES = ("default", "render", "proxy", "guide")  # UsdGeomImageable's

# Beyond these a request is a mistake or an attack, not a picture.
MAX_RESOLUTION = 2**17  # a side: in floats a pixel beyond is known to less than its 128th part
MAX_PIXELS = 2**28
MAX_SPP = 2**24
DEFAULT_SPP = 64
QUICK_LOOK = 4  # samples; renders of fewer start at once
# Samples a pixel that stand together: each replicate takes one of them. Ranges of samples begin and end between blocks.
SAMPLE_BLOCK = 2
MAX_THREADS = 1024


@dataclass(frozen=True)
class RenderSettings:
    camera: str | None = None  # prim path, or the name of a camera if only one has it
    render_settings: str | None = None  # prim path; None: what the stage's metadata name, else its only RenderSettings
    product: str | None = None  # prim path of one of their RenderProducts; None: the first
    resolution: tuple[int, int] | None = None  # width, height; one of them 0: by the camera's aspect
    resolution_scale: float = 1.0  # of the resolution, whoever chose it
    time_code: float | None = None  # None: the stage's default time
    spp: int | None = None  # at most so many samples a pixel; None: 64, or no limit where an error or a time is asked for
    # Stop when the error's estimate is not above this, or after so many seconds of sampling, whichever comes first.
    target_error: float | None = None
    error_metric: Metric = Metric.RELMSE
    time_limit_s: float | None = None
    adaptive: bool | None = None  # more samples where the error is; None: wherever an error is asked for
    sample_range: tuple[int, int] | None = None  # only these of each pixel's samples, to be merged with others
    max_depth: int | None = None  # surface scatterings, 1 = direct light only
    filter: Filter = Filter.BOX
    filter_width: float | None = None
    threads: int | None = None  # None: every core this process may use
    seed: int = 0
    default_light: bool = True
    rendering_color_space: str | None = None  # a linear RGB space; None: RenderSettings' renderingColorSpace, else Rec.709
    purposes: tuple[str, ...] | None = None  # None: RenderSettings' includedPurposes, else default and render
    aovs: tuple[str, ...] | None = None  # outputs beside the picture (aov_names.AOVS); None: what the stage's product orders
    strict: bool = False
    max_memory_bytes: int | None = None
    dicing_rate: float = DEFAULT_DICING_RATE  # pixels: the longest that edges of subdivision surfaces may be
    # How the stage is composed; meaning as in Composition. All frames of one command share it.
    variants: tuple[str, ...] = ()
    load: tuple[str, ...] | None = None
    mask: tuple[str, ...] | None = None
    session_layer: str | None = None

    @property
    def most_samples(self) -> int:
        """A pixel's samples at the end, if nothing stops the render before."""
        if self.sample_range is not None:
            return self.sample_range[1]
        if self.spp is not None:
            return self.spp
        return MAX_SPP if self.stops_early else DEFAULT_SPP

    @property
    def is_quick_look(self) -> bool:
        """So few samples are asked for that no pilot could pay for itself: paths are neither split nor guided."""
        return self.sample_range is None and not self.stops_early and self.most_samples < QUICK_LOOK

    @property
    def screen_block(self) -> int:
        """Samples of each replicate and pixel that one sequence over the whole screen gives to a quick look: errors of
        neighbours make up for each other then. 0 where any number of samples may follow: each pixel has its own."""
        return (0, 1, 1, 2)[self.most_samples] if self.is_quick_look else 0

    @property
    def stops_early(self) -> bool:
        return self.target_error is not None or self.time_limit_s is not None

    @property
    def adapts(self) -> bool:
        return self.target_error is not None and self.sample_range is None if self.adaptive is None else self.adaptive

    @property
    def composition(self) -> Composition:
        """What is given by its path is populated whatever the mask."""
        mask = self.mask
        if mask:
            asked = (self.camera, self.render_settings, self.product)
            mask = (*mask, *(path for path in asked if path is not None and path.startswith("/")))
        return Composition(self.variants, self.load, mask, self.session_layer)

    def __post_init__(self) -> None:
        """SettingsError or LimitError if no render could follow these."""
        if self.resolution is not None:
            _check_resolution(*self.resolution)
        scale = self.resolution_scale
        _require(0 < scale <= MAX_RESOLUTION, f"the resolution's scale must be above 0 and sensible, not {scale}")
        self._check_sampling()
        depth, width, threads = self.max_depth, self.filter_width, self.threads
        _require(
            depth is None or (_is_whole(depth) and depth >= 1), f"the depth must be 1 (direct light only) or more, not {depth}"
        )
        _require(
            width is None or (math.isfinite(width) and width > 0),
            f"the filter's width must be a number of pixels above 0, not {width}",
        )
        _require(threads is None or (_is_whole(threads) and threads >= 1), f"the threads must be 1 or more, not {threads}")
        _limit(threads is None or threads <= MAX_THREADS, f"{threads} threads are more than the {MAX_THREADS} allowed")
        _require(_is_whole(self.seed) and 0 <= self.seed < 2**32, f"the seed must be from 0 to 2^32 - 1, not {self.seed}")
        _require(
            self.time_code is None or math.isfinite(self.time_code), f"the time code must be a number, not {self.time_code}"
        )
        memory = self.max_memory_bytes
        _require(memory is None or memory > 0, f"the memory limit must be above 0 bytes, not {memory}")
        rate = self.dicing_rate
        _require(math.isfinite(rate) and rate > 0, f"the dicing rate must be a number of pixels above 0, not {rate}")
        unknown = sorted(set(self.purposes or ()) - set(PURPOSES))
        _require(not unknown, f"no purpose {', '.join(unknown)}; there are {', '.join(PURPOSES)}")
        _require(self.purposes != (), "at least one purpose must be rendered")
        if self.aovs is not None:
            check_names(self.aovs)
        self.composition  # noqa: B018 - checks itself

    def _check_sampling(self) -> None:
        spp, target, seconds = self.spp, self.target_error, self.time_limit_s
        _require(spp is None or (_is_whole(spp) and spp >= 1), f"samples per pixel must be a whole number from 1, not {spp}")
        _limit(
            spp is None or spp <= MAX_SPP, f"{spp} samples per pixel are more than the {MAX_SPP} that a pixel's sequence holds"
        )
        _require(target is None or (math.isfinite(target) and target > 0), f"the target error must be above 0, not {target}")
        _require(
            seconds is None or (math.isfinite(seconds) and seconds > 0),
            f"the time limit must be above 0 seconds, not {seconds}",
        )
        if self.sample_range is None:
            return
        first, end = self.sample_range
        _require(
            _is_whole(first) and _is_whole(end) and 0 <= first < end and first % SAMPLE_BLOCK == 0 and end % SAMPLE_BLOCK == 0,
            f"a sample range begins and ends at multiples of the sample block, which is {SAMPLE_BLOCK}, and holds samples; "
            f"{first}:{end} does not",
        )
        _limit(end <= MAX_SPP, f"sample {end} is beyond the {MAX_SPP} that a pixel's sequence holds")
        _require(
            spp is None and not self.stops_early and not self.adaptive,
            "a sample range says which samples are taken: no spp, target error, time limit or adaptive sampling with it",
        )


def settings_of_json(values: Mapping[str, Any]) -> RenderSettings:
    """What report.settings_as_json made; TypeError or ValueError for names or choices that there are not."""
    names = ("resolution", "sample_range", "purposes", "aovs", "variants", "load", "mask")
    tuples = {name: tuple(values[name]) for name in names if values.get(name) is not None}
    chosen = {"filter": Filter(values["filter"]), "error_metric": Metric(values["error_metric"])}
    return RenderSettings(**{**values, **tuples, **chosen})


def _check_resolution(width: int, height: int) -> None:
    whole = _is_whole(width) and _is_whole(height) and min(width, height) >= 0 and max(width, height) > 0
    _require(whole, f"the resolution must be whole pixels above 0 (one of them 0: by the aspect), not {width} x {height}")
    limit_pixels(width, height)


def limit_pixels(width: int, height: int, where: str = "") -> None:
    """LimitError if an image of this size is too large; `where`: who asks for it."""
    fits = max(width, height) <= MAX_RESOLUTION and width * height <= MAX_PIXELS
    _limit(fits, f"{width} x {height} pixels: {MAX_RESOLUTION} a side and {MAX_PIXELS} in all are allowed", where)


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _require(holds: bool, sentence: str) -> None:
    if not holds:
        raise SettingsError(sentence)


def _limit(holds: bool, sentence: str, where: str = "") -> None:
    if not holds:
        raise LimitError(sentence, where=where)
