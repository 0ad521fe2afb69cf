"""Forecast of a render in progress, between measurements: its current error and when it will end.

Both are extrapolated from the last measurement at the rate at which errors fell (error.py); intervals widen with the
distance from it. Forecasts are for display only and decide nothing.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..settings import MAX_SPP, Metric
from .error import FASTEST, SLOWEST, Z95, ErrorRow, Estimate
from .prediction import BETWEEN_BLOCKS, OF_SPEED
from .schedule import FIRST_ANCHOR, FIRST_PLAN

if TYPE_CHECKING:
    from .sampling import Sampling

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
        spread = math.hypot(_width(measured), half * self._per_doubling() * doublings)
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
        width = _width(measured) * (1.0 if self._is_squared() else 2.0) / self._rate()
        return min(float(end), float(MAX_SPP)), math.hypot(width, BETWEEN_BLOCKS, self._per_doubling() * further)


def _at(by_target: tuple[float, float], end: int, samples: float, each: float) -> float:
    """Return seconds left if the target takes the expected samples (0), or the fewest (-1) or most (1) of the interval."""
    needed, spread = by_target
    return max(needed * math.exp(min(end * Z95 * math.hypot(spread, OF_SPEED), 50.0)) - samples, 0.0) * each


def _width(estimate: Estimate) -> float:
    """Return the standard deviation of an estimate's logarithm."""
    return math.log(max(estimate.high, 1e-300) / max(estimate.low, 1e-300)) / (2 * Z95)
