"""Prediction of cost before a render, and forecast of a render in progress: samples and seconds to error targets.

Before a render, a pilot of a few seconds of the same render is measured. Its anchors show how large the error is and how fast
it falls; from the last one on, tiles are doubled as in adaptive sampling (adaptive.py), each time with the factor that the
pilot measured for the whole picture. Seconds are rays times the pilot's seconds per ray, and the cost of measurements.

A forecast between measurements has the current error and when the render will end, extrapolated from the last measurement at
the rate at which errors fell (error.py); intervals widen with the distance from it. Forecasts are for display only and decide
nothing.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import core
from ..settings import MAX_SPP, SAMPLE_BLOCK, Metric, RenderSettings
from .adaptive import Counts, Plan, make_plan
from .error import ALL_PIXELS, FASTEST, SLOWEST, Z95, ErrorRow, Estimate, fewest_samples, is_reliable
from .sampling import Progress, Sampling
from .schedule import FIRST_ANCHOR, FIRST_PLAN

if TYPE_CHECKING:
    from .sampling import Sampling


DOUBLINGS = 20
# A render plans again at each doubling, with better data than the pilot's plan: the factor of samples that it needs, for each
# doubling. Fitted to 30 renders each of five stages, from pilots of 16 samples to targets that took about 100.
REPLANNING = 0.94
# Uncertainty of the samples' logarithm, for each doubling beyond the pilot and because targets fall between blocks; and
# additional uncertainty of the seconds, since other work shares the machine.
PER_DOUBLING, BETWEEN_BLOCKS, OF_SPEED = 0.06, 0.04, 0.08
# Samples that renders with uncertain errors took, relative to those at which the interval should be narrow enough: 1.4 to
# 4.3 in nine renders of glass and gold balls, from pilots of 8 samples.
WAIT = 2.0


@dataclass(frozen=True)
class Prediction:
    """Mean samples per pixel and seconds of sampling for one target, with 95 % intervals; None if out of reach."""

    target: float
    samples: Estimate | None
    seconds: Estimate | None

    def as_json(self) -> dict[str, Any]:
        found = {"target_error": self.target}
        return found | {
            name: None if e is None else e.as_json() for name, e in (("samples", self.samples), ("seconds", self.seconds))
        }


@dataclass(frozen=True)
class Pilot:
    """Results of a pilot render, which predict the cost of any target."""

    sampling: Sampling
    row: ErrorRow
    seconds_per_ray: float
    seconds_per_measurement: float

    @property
    def metric(self) -> Metric:
        return self.sampling.settings.metric

    def predict(self, target: float) -> Prediction:
        """Return samples and seconds until the error is known to be no larger than `target`."""
        rows = self.sampling.rows
        last = next((i for i, row in enumerate(rows) if self._is_within(row, target) and is_reliable(row, self.metric)), None)
        if last == 0:
            return self._prediction(target, Estimate.around(rows[0].samples, BETWEEN_BLOCKS), self._rays(rows[0].samples))
        # Start at the last measurement that does not end the render; the pilot may have measured the rate from there.
        start = rows[-1] if last is None else rows[last - 1]
        rate = self.sampling.curve.rate() if last is None else self._rate(start, rows[last])
        if self._is_within(start, target):
            samples = start.samples
            known = Estimate(samples, samples, samples * max(1.0, 1 / self._part(target, start, high=True)) ** (1 / rate))
        else:
            samples, rays = self._to(self._part(target, start), start, rate, replanning=last is None)
            further = max(math.log2(samples / self.row.samples), 0.0) if math.isfinite(samples) else 0.0
            spread = math.hypot(self._width(start) / rate, BETWEEN_BLOCKS, PER_DOUBLING * further)
            known = Estimate.around(samples, spread)
        waited = self._wait(start, math.inf if last is None else rows[last].samples)
        needed = Estimate(*(max(getattr(known, end), getattr(waited, end)) for end in ("value", "low", "high")))
        if self._is_within(start, target) or needed.value > samples:
            rays = self._rays_of_wait(start, needed.value)
        return self._prediction(target, needed, rays)

    def _prediction(self, target: float, samples: Estimate, rays: float) -> Prediction:
        """Return the prediction for `samples` per pixel, of which `samples.value` trace `rays`."""
        if samples.value > (self.sampling.settings.spp or MAX_SPP):
            return Prediction(target, None, None)
        # Measurements take place at the anchors, where the target should be reached, and at the end.
        measurements = max(math.log2(samples.value / FIRST_ANCHOR), 0.0) + 3
        seconds = rays * self.seconds_per_ray + measurements * self.seconds_per_measurement
        factor = math.exp(Z95 * OF_SPEED)
        low, high = samples.low / samples.value / factor, samples.high / samples.value * factor
        return Prediction(target, samples, Estimate(seconds, seconds * low, seconds * high))

    def _wait(self, row: ErrorRow, end: float) -> Estimate:
        """Return samples per pixel at which an error as uncertain as the row's can meet a target, at the latest at `end`.

        The upper end is where it may meet a target with the interval as wide as now; the lower, where the interval is narrow
        enough if its logarithm falls as 1 / sqrt(samples). The pilot cannot know which applies.
        """
        doubt = row.error.of(self.metric).doubt
        most = min(fewest_samples(doubt), end, float(self.sampling.settings.most_samples))
        if most <= row.samples:
            return Estimate(0.0, 0.0, 0.0)
        least = row.samples
        while least < most and least < fewest_samples(doubt ** math.sqrt(row.samples / least)):
            least = min(least * 1.05, most)
        return Estimate(min(WAIT * least, most), least, most)

    def _is_within(self, row: ErrorRow, target: float) -> bool:
        return row.error.of(self.metric).value <= target

    def _squared(self, row: ErrorRow, *, high: bool = False) -> float:
        known = row.error.of(self.metric)
        value = max(known.high if high else known.value, 1e-150)
        return value if self.metric is Metric.RELMSE else value * value

    def _part(self, target: float, row: ErrorRow, *, high: bool = False) -> float:
        """Return the target as a fraction of the row's squared error, or of the high end of its interval."""
        return (target if self.metric is Metric.RELMSE else target * target) / self._squared(row, high=high)

    def _rate(self, before: ErrorRow, after: ErrorRow) -> float:
        return max(math.log(self._squared(before) / self._squared(after)) / math.log(after.samples / before.samples), SLOWEST)

    def _width(self, row: ErrorRow) -> float:
        """Return the uncertainty of the squared error's logarithm."""
        width = row.error.of(self.metric).deviation
        return width if self.metric is Metric.RELMSE else 2 * width

    def _rays(self, samples: float) -> float:
        """Return the rays of `samples` per pixel, the same number everywhere."""
        film = self.sampling.film
        width, height = film.resolution
        return film.rays * samples * width * height / film.samples

    def _to(self, part: float, row: ErrorRow, rate: float, replanning: bool) -> tuple[float, float]:
        """Return samples per pixel and rays at which the error has fallen to `part` of the row's."""
        if not self.sampling.settings.adapts or row.samples < FIRST_PLAN:
            samples = float(math.ceil(row.samples * part ** (-1 / rate) / SAMPLE_BLOCK) * SAMPLE_BLOCK)
            return samples, self._rays(samples)
        plan, begin = self._plan(row)
        samples = plan.samples_for(row.error.tiles, row.samples, part, 0.5**rate)
        if not math.isfinite(samples):
            return math.inf, math.inf
        added = self._added_rays(plan, begin, samples)
        fewer = REPLANNING ** math.log2(samples / row.samples) if replanning else 1.0
        more = max(samples * fewer, row.samples + SAMPLE_BLOCK)
        return more, self._rays(row.samples) + added * (more - row.samples) / (samples - row.samples)

    def _plan(self, row: ErrorRow) -> tuple[Plan, Counts]:
        """Return the plan of adaptive sampling from the row on, and each tile's samples of a replicate there."""
        film = self.sampling.film
        begin = np.full(len(film.tile_rays), round(row.samples) // 2, np.int64)
        return make_plan(film, row.error.tiles, round(row.samples), begin, DOUBLINGS), begin

    def _added_rays(self, plan: Plan, begin: Counts, samples: float) -> float:
        film = self.sampling.film
        each = film.tile_rays / np.maximum(film.next.sum(axis=0), 1)  # rays per sample in each tile
        return float((2 * (plan.ends(math.ceil(samples))[0] - begin) * each).sum())

    def _rays_of_wait(self, row: ErrorRow, samples: float) -> float:
        """Return the rays of a render that continues from the row, whose error is small enough, to `samples` per pixel."""
        if not self.sampling.settings.adapts or samples < FIRST_PLAN:
            return self._rays(samples)
        return self._rays(row.samples) + self._added_rays(*self._plan(row), samples)


def run_pilot(
    scene: core.CoreScene, settings: RenderSettings, seconds: float, progress: Progress | None = None
) -> Pilot | None:
    """Sample up to the last anchor that about `seconds` allow; None if Ctrl-C, or `progress`, stops it.

    If the first anchor alone takes more than three times as long, the samples until then are used; where these are too few to
    estimate an error (two a pixel), the time is doubled until they are enough.
    """
    samples = FIRST_ANCHOR
    uniform = replace(settings, spp=samples, time_limit_s=3 * seconds, target_error=None, adaptive=False)
    sampling = Sampling.begin(scene, uniform)
    sampling.schedule = replace(sampling.schedule, pilot=True)
    while True:
        sampling.run(progress)
        assert sampling.stop is not None
        if sampling.stop.reason == "interrupted":
            return None
        if sampling.stop.reason == "time-limit" and not sampling.rows:
            uniform = replace(uniform, time_limit_s=2 * sampling.seconds)
            sampling.schedule = replace(sampling.schedule, settings=uniform)
            continue
        if sampling.stop.reason == "time-limit" or 2 * sampling.seconds > seconds or 2 * samples > MAX_SPP:
            break
        samples *= 2
        sampling.schedule = replace(sampling.schedule, settings=replace(uniform, spp=samples))
    sampling.schedule = replace(sampling.schedule, settings=settings)
    before = time.perf_counter()
    sampling.film.error_sums(ALL_PIXELS, core.threads(settings))
    measuring = time.perf_counter() - before
    sampled = max(sampling.seconds - measuring * len(sampling.rows), 0.1 * sampling.seconds)
    return Pilot(sampling, sampling.rows[-1], sampled / max(sampling.film.rays, 1), measuring)


def usual_targets(pilot: Pilot) -> Sequence[float]:
    """Return round targets below the pilot's error: 1, 2 and 5 times powers of ten."""
    value = pilot.row.error.of(pilot.metric).value
    if not value > 0:
        return []
    steps = [digit * 10.0**power for power in range(math.floor(math.log10(value)), -9, -1) for digit in (5, 2, 1)]
    return [step for step in steps if step < value][:6]


# Uncertainty of a squared error's logarithm for each doubling of samples, before and after two anchors have shown its rate.
UNKNOWN_RATE, KNOWN_RATE = 0.35, 0.15
# Rate at which errors fall when adaptive sampling has begun (its first doubling gains most), and the share of a measured
# rate's excess over 1 that later doublings keep. Fitted to five stages and twelve targets; test_forecast_accuracy.py has some.
ADAPTIVE_RATE, ADAPTIVE_TRUST = 1.35, 0.4
WINDOW = 0.5  # the last share of the run's time that speeds are measured over


@dataclass(frozen=True)
class Forecast:
    """Current error and seconds left; None: not known yet, or no end can be predicted."""

    error: Estimate | None
    left_s: Estimate | None


@dataclass
class Forecaster:
    """Forecasts of one sampling. `tail_s`: seconds from the last sample to the end of all work."""

    sampling: Sampling
    tail_s: float = 0.0
    marks: deque[tuple[float, float]] = field(default_factory=deque)  # seconds and samples per pixel of this run

    def __post_init__(self) -> None:
        self.start_s = self.sampling.seconds
        self.marks.append((self.start_s, self.sampling.mean_samples()))

    def look(self) -> Forecast:
        samples, seconds = self.sampling.mean_samples(), self.sampling.now_s
        self.marks.append((seconds, samples))
        return Forecast(self._error(samples), self._left(samples, seconds))

    def _row(self) -> ErrorRow | None:
        return self.sampling.curve.last

    def _error(self, samples: float) -> Estimate | None:
        row = self._row()
        if row is None:
            return None
        measured = row.error.of(self.sampling.settings.metric)
        doublings = math.log2(max(samples / row.samples, 1.0))
        if doublings == 0 or not measured.value > 0:
            return measured
        half = 1.0 if self._is_squared() else 0.5
        spread = math.hypot(measured.deviation, half * self._per_doubling() * doublings)
        return Estimate.around(measured.value * 2 ** (-half * self._rate() * doublings), spread)

    def _is_squared(self) -> bool:
        return self.sampling.settings.metric is Metric.RELMSE

    def _alike(self) -> list[ErrorRow]:
        """Return measurements with the sampling pattern of the rest of the render: from the first plan on, if there is one."""
        first = 2 * FIRST_PLAN if self.sampling.settings.adapts else FIRST_ANCHOR
        return [row for row in self.sampling.rows if row.anchor and row.samples >= 0.9 * first]

    def _rate(self) -> float:
        """Return the power of 1 / samples with which squared errors will fall."""
        if not self.sampling.settings.adapts:
            return self.sampling.curve.rate()
        rows = self._alike()
        if len(rows) < 2:
            return ADAPTIVE_RATE
        before, after = (row.error.of(self.sampling.settings.metric).value for row in rows[-2:])
        if not (before > 0 and after > 0):
            return ADAPTIVE_RATE
        seen = math.log(before / after) / math.log(rows[-1].samples / rows[-2].samples) * (1 if self._is_squared() else 2)
        return min(max(1 + ADAPTIVE_TRUST * (seen - 1), SLOWEST), FASTEST)

    def _per_doubling(self) -> float:
        return KNOWN_RATE if len(self._alike()) >= 2 else UNKNOWN_RATE

    def _left(self, samples: float, seconds: float) -> Estimate | None:
        """Return the seconds until the first stopping rule applies: each end of the interval is the minimum over the rules."""
        settings = self.sampling.settings
        rules: list[Estimate] = []
        each = self._seconds_a_sample(samples, seconds)
        if each is not None:
            if settings.spp is not None or not settings.stops_early:
                rules.append(Estimate.around(max(settings.most_samples - samples, 0.0) * each, OF_SPEED))
            by_target = self._samples_to_target(samples)
            if by_target is not None:
                rules.append(Estimate(*(_at(by_target, end, samples, each) for end in (0, -1, 1))))
        if settings.sampling_time_s is not None:
            left = max(settings.sampling_time_s - (seconds - self.sampling.schedule.earlier_seconds), 0.0)
            rules.append(Estimate(left, left, left))
        if not rules:
            return None
        ends = [min(getattr(rule, name) for rule in rules) + self.tail_s for name in ("value", "low", "high")]
        return Estimate(*ends)

    def _seconds_a_sample(self, samples: float, seconds: float) -> float | None:
        """Return the cost over the last part of this run, since passes differ in cost and the machine's load varies."""
        since = self.start_s + (1 - WINDOW) * (seconds - self.start_s)
        while len(self.marks) > 1 and self.marks[1][0] <= since:
            self.marks.popleft()
        begin_s, begin = self.marks[0]
        return (seconds - begin_s) / (samples - begin) if samples > begin and seconds > begin_s else None

    def _samples_to_target(self, samples: float) -> tuple[float, float] | None:
        """Return samples per pixel at which the target should be reached, and the uncertainty of their logarithm."""
        target, row = self.sampling.settings.target_error, self._row()
        if target is None or row is None:
            return None
        measured = row.error.of(self.sampling.settings.metric)
        if not measured.value > 0:
            return samples, 0.0
        power = 1.0 if self._is_squared() else 2.0
        end = row.samples * max(measured.value / target, 1.0) ** (power / self._rate())
        end = max(end, self.sampling.expected_end() or 0)  # the error is not measured before
        further = max(math.log2(min(end, MAX_SPP) / row.samples), 0.0)
        width = measured.deviation * (1.0 if self._is_squared() else 2.0) / self._rate()
        return min(float(end), float(MAX_SPP)), math.hypot(width, BETWEEN_BLOCKS, self._per_doubling() * further)


def _at(by_target: tuple[float, float], end: int, samples: float, each: float) -> float:
    """Return seconds left if the target takes the expected samples (0), or the fewest (-1) or most (1) of the interval."""
    needed, spread = by_target
    return max(needed * math.exp(min(end * Z95 * math.hypot(spread, OF_SPEED), 50.0)) - samples, 0.0) * each
