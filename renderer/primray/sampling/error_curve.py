"""Error curve: measurements by sample count, how fast the error falls, and when it should reach a target."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..settings import MAX_SPP, SAMPLE_BLOCK, Metric
from .error import FrameError

if TYPE_CHECKING:
    from .adaptive import Plan

# Squared errors that fall slower than 1 / sqrt(samples), or faster than 1 / samples^2, are measurement noise. TRUST: the share
# of the measured power's distance from 1 that is kept.
SLOWEST, FASTEST, TRUST = 0.5, 2.0, 0.7
USUAL_RATE = 1.2  # before it has been measured
# An error that is known to the factor WELL_KNOWN can meet a target from FEWEST samples per pixel on. One known half as well
# needs four times as many: few samples may have found some bright pixels and missed others.
WELL_KNOWN, FEWEST = 1.25, 8


def fewest_samples(doubt: float) -> float:
    """Return the samples per pixel below which an error that may be larger by the factor `doubt` cannot meet a target."""
    return FEWEST * max(doubt / WELL_KNOWN, 1.0) ** 2


@dataclass(frozen=True)
class Row:
    """One measurement of the error, after a mean number of samples per pixel and seconds of sampling."""

    samples: float
    seconds: float
    error: FrameError
    anchor: bool
    due: bool = False  # whether the target was expected to be reached here

    @property
    def decides(self) -> bool:
        """Whether any render of these samples with this target would have measured here."""
        return self.anchor or self.due

    def as_json(self) -> dict[str, Any]:
        found = {"samples": self.samples, "seconds": self.seconds, "relmse": self.error.relmse.value}
        return found | {"ci95": [self.error.relmse.low, self.error.relmse.high], "rmse": self.error.rmse.value}


def is_held(row: Row, metric: Metric) -> bool:
    """Return whether the row's error is known well enough, for its samples, to be compared with a target."""
    return row.samples >= fewest_samples(row.error.of(metric).doubt)


@dataclass(frozen=True)
class ErrorCurve:
    """All measurements, with the rate and extrapolation in one metric."""

    metric: Metric
    rows: tuple[Row, ...] = ()

    @property
    def last(self) -> Row | None:
        return self.rows[-1] if self.rows else None

    def at(self, samples: float) -> Row | None:
        """Return the last measurement if it is at exactly `samples` per pixel, else None."""
        return self.last if self.last is not None and self.last.samples == samples else None

    def add(self, row: Row) -> ErrorCurve:
        return replace(self, rows=(*self.rows, row))

    def change_last(self, row: Row) -> ErrorCurve:
        """Return the curve with its last row replaced."""
        return replace(self, rows=(*self.rows[:-1], row))

    def rate(self) -> float:
        """Return the power of 1 / samples with which squared errors fall, from the last two anchors."""
        anchors = [row for row in self.rows if row.anchor]
        if len(anchors) < 2:
            return USUAL_RATE
        before, after = anchors[-2].error.of(self.metric).value, anchors[-1].error.of(self.metric).value
        if not (before > 0 and after > 0):
            return USUAL_RATE
        seen = math.log(before / after) / math.log(anchors[-1].samples / anchors[-2].samples)
        if self.metric is not Metric.RELMSE:
            seen *= 2
        return min(max(1 + TRUST * (seen - 1), SLOWEST), FASTEST)

    def expected_samples(self, target: float, plan: Plan | None = None) -> float | None:
        """Return samples per pixel at which the target should be reached, at most MAX_SPP; None before any measurement.

        `plan`: the plan of adaptive sampling from the last anchor on.
        """
        row = next((row for row in reversed(self.rows) if row.decides), None)
        if row is None:
            return None
        part = min(target / max(row.error.of(self.metric).value, 1e-300), 1.0)
        part **= 1.0 if self.metric is Metric.RELMSE else 2.0
        rate = self.rate()
        samples = row.samples * math.pow(part, -1 / rate)
        if plan is not None and row.samples >= plan.samples:
            planned = plan.samples_for(row.error.tiles, row.samples, part, 0.5**rate)
            samples = planned if math.isfinite(planned) else max(samples, 2.0 * plan.samples + SAMPLE_BLOCK)
        return min(max(samples, fewest_samples(row.error.of(self.metric).doubt)), float(MAX_SPP))
