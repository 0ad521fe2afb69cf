"""Readings of light meters from the film's two replicates, with intervals, and when they are precise enough.

The estimate of a meter is the mean over its pixels of (A + B) / 2, whose variance is the sum of ((A - B) / 2)^2 over their
number squared: replicates and pixels are independent. Its freedom is Welch and Satterthwaite's, since few pixels may rule it.

Where no sample of a meter found light, its two halves agree, and that proves nothing: paths of a share of 3 / n are missed by n
samples with a chance of 5 %. Its interval ends at what such paths give if each brings what the brightest meter reads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..color.color_space import luminance_weights
from ..errors import SettingsError
from ..sampling.error import Z95, student_quantile
from ..sampling.sampling import Sampling
from .facets import SIDES, by_meter
from .meters import CODE, LightMeter

UNSEEN = 3.0  # over n: the share of paths that n samples miss with a chance of 5 %
USUAL_TARGET = 0.02
LEFT = 4096  # samples after which a meter without light is left, and measured alone, so that the others need not wait for it
DARK = 1e-3  # of the largest reading: what is darker is asked for as if it were as bright as that


@dataclass(frozen=True)
class Reading:
    """What a light meter reads: `value` with the ends of its 95 % interval; lux, or a share of 1 for daylight factors.

    `met`: the precision that was asked for is reached.
    """

    meter: LightMeter
    value: float
    low: float
    high: float
    met: bool

    @property
    def half_width(self) -> float:
        return (self.high - self.low) / 2

    def as_json(self) -> dict[str, Any]:
        meter, facts = self.meter, {"value": self.value, "ci95": [self.low, self.high], "met": self.met}
        return {"name": meter.name, "kind": meter.kind.value, "grid": meter.grid, "position": list(meter.position)} | facts


@dataclass(frozen=True)
class GridReading:
    """What the meters of a grid read together, each with its 95 % interval: (value, low, high).

    `uniformity` is the least over the mean (EN 12464-1, U0). The least of noisy readings is low by chance; its interval is that
    of the meters which may be the least.
    """

    name: str
    count: int
    mean: tuple[float, float, float]
    least: tuple[float, float, float]
    most: tuple[float, float, float]
    uniformity: tuple[float, float, float]

    def as_json(self) -> dict[str, Any]:
        rows = {name: getattr(self, name) for name in ("mean", "least", "most", "uniformity")}
        return {"name": self.name, "count": self.count} | {
            name: {"value": value, "ci95": [low, high]} for name, (value, low, high) in rows.items()
        }


@dataclass(frozen=True)
class Precision:
    """How precise readings are to be: half of a 95 % interval at most `target` times the value.

    `of_mean`: of each grid's mean alone, rather than of each meter. `simultaneous`: intervals hold for all meters together with
    95 % (Bonferroni), not for each.
    """

    target: float
    of_mean: bool = False
    simultaneous: bool = False
    count: int = 1  # of all meters

    def __post_init__(self) -> None:
        if not (isinstance(self.target, int | float) and 0 < self.target < 1):
            raise SettingsError(f"the precision is a share between 0 and 1, not {self.target!r}", where="target", code=CODE)

    @property
    def z(self) -> float:
        """The normal quantile of an interval's end."""
        return NormalDist().inv_cdf(1 - 0.025 / self.count) if self.simultaneous else Z95


@dataclass(frozen=True)
class Measured:
    """Estimates of N meters and their errors: `values`, `deviations`, `freedom` and the number of `samples`, each (N,)."""

    values: Doubles
    deviations: Doubles
    freedom: Doubles
    samples: Doubles

    @classmethod
    def of(cls, sampling: Sampling, count: int) -> Measured:
        """Return illuminances in lux from the radiances of facets of albedo 1."""
        film, weights = sampling.film, np.array(luminance_weights(sampling.scene.rendering_space))
        sums = film.replicates[..., :3] @ weights
        means = sums / np.maximum(film.counts, 1)
        a, b = math.pi * by_meter(means[0], count), math.pi * by_meter(means[1], count)
        squares = (0.5 * (a - b)) ** 2
        total = squares.sum(axis=1)
        freedom = np.where(total > 0, total**2 / np.maximum((squares**2).sum(axis=1), 1e-300), SIDES)
        samples = np.maximum(by_meter(film.counts.sum(axis=0), count).sum(axis=1), 1).astype(np.float64)
        return cls((0.5 * (a + b)).mean(axis=1), np.sqrt(total) / SIDES, freedom, samples)

    @classmethod
    def none(cls, count: int) -> Measured:
        return cls(np.zeros(count), np.zeros(count), np.full(count, float(SIDES)), np.ones(count))

    def put(self, rows: list[int], measured: Measured) -> None:
        """Set some meters."""
        self.values[rows], self.deviations[rows] = measured.values, measured.deviations
        self.freedom[rows], self.samples[rows] = measured.freedom, measured.samples

    def half_widths(self, z: float) -> Doubles:
        """Return half of each interval; of a meter that no sample found light for, all of it."""
        found = np.asarray(self.deviations * [student_quantile(n, z) for n in self.freedom.tolist()])
        return np.where(self.is_unlit, UNSEEN / self.samples * self.values.max(initial=0.0), found)

    @property
    def is_unlit(self) -> npt.NDArray[np.bool_]:
        """Whether no sample of a meter found light (N,)."""
        return np.asarray((self.values == 0) & (self.deviations == 0))

    def is_sought(self, precision: Precision) -> npt.NDArray[np.bool_]:
        """Whether a meter has so many samples that it may be called dark if none found light (N,)."""
        return np.asarray(UNSEEN / self.samples <= min(precision.target, USUAL_TARGET) * DARK)

    def over(self, by: float) -> Measured:
        return Measured(self.values / by, self.deviations / by, self.freedom, self.samples)


def is_met(
    measured: Measured, meters: tuple[LightMeter, ...], precision: Precision, brightest: float = 0.0
) -> npt.NDArray[np.bool_]:
    """Return for each meter whether its reading, or the mean of its grid, is as precise as asked.

    `brightest`: the largest reading of other meters.
    """
    values, widths = measured.values, measured.half_widths(precision.z)
    dark = DARK * max(float(values.max(initial=0.0)), brightest)
    # Without any light, as many samples are taken as would be with some on another meter.
    met = np.where(measured.is_unlit, measured.is_sought(precision), widths <= precision.target * np.maximum(values, dark))
    if precision.of_mean:
        for rows in rows_by_grid(meters).values():
            mean, width = mean_of(measured, rows)
            met[rows] = width <= precision.target * max(mean, dark) if mean > 0 else met[rows]
    return met


def rows_by_grid(meters: tuple[LightMeter, ...]) -> dict[str, list[int]]:
    """Return the numbers of the meters of each grid."""
    found: dict[str, list[int]] = {}
    for k, meter in enumerate(meters):
        if meter.grid:
            found.setdefault(meter.grid, []).append(k)
    return found


def mean_of(measured: Measured, rows: list[int]) -> tuple[float, float]:
    """Return the mean of some meters and half of its 95 % interval; their errors are independent."""
    squares = measured.deviations[rows] ** 2
    total = float(squares.sum())
    freedom = total**2 / max(float((squares**2 / measured.freedom[rows]).sum()), 1e-300) if total > 0 else SIDES
    return float(measured.values[rows].mean()), student_quantile(freedom) * math.sqrt(total) / len(rows)


def readings_of(measured: Measured, meters: tuple[LightMeter, ...], precision: Precision) -> list[Reading]:
    widths, met = measured.half_widths(precision.z), is_met(measured, meters, precision)
    return [
        Reading(meter, value, max(value - width, 0.0), value + width, ok)
        for meter, value, width, ok in zip(meters, measured.values.tolist(), widths.tolist(), met.tolist(), strict=True)
    ]


def grids_of(measured: Measured, readings: list[Reading]) -> list[GridReading]:
    """Return each grid's mean, least, most and uniformity."""
    found = []
    for name, rows in rows_by_grid(tuple(reading.meter for reading in readings)).items():
        mean, width = mean_of(measured, rows)
        own = [readings[k] for k in rows]
        least = _extreme(own, min)
        most = _extreme(own, max)
        low, high = max(mean - width, 0.0), mean + width
        even = tuple(a / b if b > 0 else 0.0 for a, b in ((least[0], mean), (least[1], high), (least[2], max(low, 1e-300))))
        uniformity = (even[0], even[1], min(even[2], 1.0))
        found.append(GridReading(name, len(rows), (mean, low, high), least, most, uniformity))
    return found


def _extreme(readings: list[Reading], which: Any) -> tuple[float, float, float]:
    """Return the least or the largest value; the ends of its interval are the least or largest ends."""
    return which(r.value for r in readings), which(r.low for r in readings), which(r.high for r in readings)


@dataclass
class PrecisionJudge:
    """A `sampling.sampling.Judge`: whether all readings are as precise as asked."""

    meters: tuple[LightMeter, ...]
    precision: Precision
    brightest: float | None  # the largest reading of other meters; None: unlit meters are left to a judge that knows it

    def is_met(self, sampling: Sampling) -> bool:
        measured = Measured.of(sampling, len(self.meters))
        met = is_met(measured, self.meters, self.precision, self.brightest or 0.0)
        if self.brightest is None:
            met |= measured.is_unlit & (measured.samples >= LEFT)
        return bool(met.all())
