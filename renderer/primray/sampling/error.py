"""Estimates of the whole frame's error from the film's two replicates, each with a 95 % interval, and their curve.

relMSE: mean over pixels and channels (of the rendering space) of (I - R)^2 / (R^2 + 0.01), nothing clamped. RMSE: root of the
mean of (I - R)^2. Display: RMSE after the display's view, in steps of 8 bits. I is the delivered picture, R its limit; the
interval is for this picture's error, not for the average of such pictures.

The curve of measurements over samples gives the rate at which the error falls, and when it should reach a target.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Doubles, Floats
from ..color import ocio as color
from ..color.color_space import REC709, ColorSpace
from ..settings import MAX_SPP, SAMPLE_BLOCK, Metric

if TYPE_CHECKING:
    from ..core import Film, compiled
    from .adaptive import Plan


Z95 = 1.959964  # standard deviations of a normal distribution that contain 95 %
FREEDOM = 1 / 12  # by coverage on nine scenes: docs/decisions/measuring/upper-ends.md
ALL_PIXELS = 1 << 62
ONE_PERCENT = 1e-4  # relMSE: the square of an error of 1 %
DISPLAY_PIXELS = 1 << 14  # a view costs 0.6 microseconds a pixel; this many give its error to a percent


def student_quantile(freedom: float, z: float = Z95) -> float:
    """Return the quantile of Student's t distribution at the probability where the normal one's is `z`, by default half of a
    95 % interval; with at least 2 degrees of freedom.

    Abramowitz and Stegun 26.7.5.
    """
    n = max(freedom, 2.0)
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
    )
    return z + sum(term / n**power for power, term in enumerate(terms, start=1))


@dataclass(frozen=True)
class Estimate:
    """An error with the ends of its 95 % interval."""

    value: float
    low: float
    high: float

    @classmethod
    def around(cls, value: float, relative_deviation: float) -> Estimate:
        """Return an interval that is symmetric in the logarithm: errors are positive, and uncertain by factors."""
        factor = math.exp(min(Z95 * relative_deviation, 50.0))
        return cls(value, value / factor, value * factor)

    @classmethod
    def of_replicates(cls, value: float, relative_deviation: float) -> Estimate:
        """Return the interval of an error that was estimated from the squares of two replicates' differences.

        The same squares give the deviation: where few pixels rule, an error that is estimated too small has too small a
        deviation as well. The upper end is therefore by Student's t, whose freedom is a share of that of the squares
        (4 / deviation^2, of a chi-squared ratio).
        """
        estimate = cls.around(value, relative_deviation)
        freedom = FREEDOM * 4 / max(relative_deviation**2, 1e-12)
        return replace(estimate, high=value * math.exp(min(student_quantile(freedom) * relative_deviation, 50.0)))

    @property
    def deviation(self) -> float:
        """The standard deviation of the estimate's logarithm."""
        return math.log(self.doubt) / Z95

    @property
    def doubt(self) -> float:
        """The factor by which the error may be smaller, and about as likely larger; 1 if it is known exactly."""
        if not self.value > 0:
            return 1.0
        return self.value / self.low if self.low > 0 else math.inf

    def root(self) -> Estimate:
        return Estimate(math.sqrt(self.value), math.sqrt(self.low), math.sqrt(self.high))

    def as_json(self) -> dict[str, Any]:
        return {"estimate": self.value, "ci95": [self.low, self.high]}


@dataclass(frozen=True)
class MixError:
    """The largest error of several mixes of lights; `worst`: which of them has the largest relMSE."""

    relmse: Estimate
    rmse: Estimate
    worst: int

    def as_json(self) -> dict[str, Any]:
        return {Metric.RELMSE.value: self.relmse.as_json(), Metric.RMSE.value: self.rmse.as_json(), "worst": self.worst}


@dataclass(frozen=True)
class FrameError:
    """Errors of a frame in each metric."""

    relmse: Estimate
    rmse: Estimate
    tiles: Doubles  # each tile's contribution to relMSE, of the worst mix where mixes of lights decide
    display: Estimate | None = None  # measured only if requested
    mix: MixError | None = None  # of the mixes of lights that a target applies to

    def of(self, metric: Metric) -> Estimate:
        """Return the error that a target applies to."""
        if self.mix is not None:
            return self.mix.rmse if metric is Metric.RMSE else self.mix.relmse
        found = {Metric.RELMSE: self.relmse, Metric.RMSE: self.rmse, Metric.DISPLAY: self.display}[metric]
        assert found is not None
        return found

    def as_json(self) -> dict[str, Any]:
        """Return estimates by metric; None for the display metric if its view cannot be made."""
        shown = None if self.display is None else self.display.as_json()
        found = {Metric.RELMSE.value: self.relmse.as_json(), Metric.RMSE.value: self.rmse.as_json()}
        return found | {Metric.DISPLAY.value: shown} | ({} if self.mix is None else {"mix": self.mix.as_json()})


def is_measurable(film: Film) -> bool:
    """Return whether every pixel has samples in both replicates; an error of some pixels is not the picture's."""
    return film.samples_per_pixel[0] >= 2


def measure(
    film: Film,
    threads: int,
    view: DisplayView | None = None,
    most_pixels: int = ALL_PIXELS,
    mixes: Doubles | None = None,
) -> FrameError | None:
    """Return the error of the film's picture, or of part of it; None if a pixel lacks samples in one replicate.

    `view` requests the error on a display too, `mixes` (M, E, 3) the largest of these mixes (mix_weights.py).
    """
    if not is_measurable(film):
        return None
    sums = film.error_sums(most_pixels, threads)
    if sums.values == 0:
        return None
    mix, ruling = (None, sums) if mixes is None else _of_mixes([film.error_sums(most_pixels, threads, mix) for mix in mixes])
    return FrameError(
        relmse=_relmse(sums),
        rmse=_rmse(sums),
        tiles=ruling.tiles / sums.values,
        display=None if view is None else _display(film, view),
        mix=mix,
    )


def _of_mixes(sums: Sequence[compiled.FrameErrorSums]) -> tuple[MixError, compiled.FrameErrorSums]:
    """Return the largest errors, and the sums of the mix with the largest relMSE."""
    of_all = [_relmse(one) for one in sums]
    worst = max(range(len(sums)), key=lambda k: of_all[k].value)
    rmse = max((_rmse(one) for one in sums), key=lambda estimate: estimate.value)
    return MixError(of_all[worst], rmse, worst), sums[worst]


def _rmse(sums: compiled.FrameErrorSums) -> Estimate:
    return _mean_square(sums.squared, sums.squared_variance, sums.values).root()


def _relmse(sums: compiled.FrameErrorSums) -> Estimate:
    total = sums.relative
    if not total > 0:
        return Estimate(0.0, 0.0, 0.0)
    # Uncertainty from sampling, and from the weights: the difference of both kinds of weights, and the effect of R's spread.
    chance = math.sqrt(max(sums.relative_variance, 0.0)) / total
    kinds = _log_ratio(sums.relative_alike, sums.relative_alone) / 2
    spread = _log_ratio(total, sums.relative_plain)
    return Estimate.of_replicates(total / sums.values, math.sqrt(chance**2 + kinds**2 + spread**2))


def _log_ratio(a: float, b: float) -> float:
    return abs(math.log(max(a, 1e-300) / max(b, 1e-300)))


def _mean_square(total: float, variance: float, values: int) -> Estimate:
    if not total > 0:
        return Estimate(0.0, 0.0, 0.0)
    return Estimate.of_replicates(total / values, math.sqrt(max(variance, 0.0)) / total)


@dataclass(frozen=True)
class DisplayView:
    """The view transform that pictures are looked at with; None: OpenColorIO's default."""

    display: str | None = None
    view: str | None = None
    exposure: float = 0.0
    space: ColorSpace = REC709  # colour space of the film

    def check(self) -> None:
        """Raise SettingsError if the OpenColorIO configuration cannot make the view."""
        color.check_display(self.view, self.display, None, self.space)

    def assumed(self) -> str | None:
        """Return the assumption that the view makes because the configuration does not say, or None."""
        return color.assumed_space(self.space)


def _display(film: Film, view: DisplayView) -> Estimate:
    """Return the display error, from random pixels viewed with their replicates' difference added and subtracted."""
    pixels, errors = film.image()
    rgb, d = pixels[..., :3].reshape(-1, 3), errors.reshape(-1, 3)
    chosen = np.flatnonzero(np.isfinite(d).all(axis=1))
    if len(chosen) > DISPLAY_PIXELS:
        chosen = np.random.default_rng(0).choice(chosen, DISPLAY_PIXELS, replace=False)
    mean, step = rgb[chosen], d[chosen]
    shown = [_shown(mean + sign * step, view) for sign in (0, 1, -1)]
    squares = 0.5 * ((shown[1] - shown[0]) ** 2 + (shown[2] - shown[0]) ** 2).sum(axis=1)
    total = float(squares.sum())
    # A pixel's d^2 has one degree of freedom: the variance of the true square minus the estimate is 4 / 3 of its square.
    return _mean_square(total, 4 / 3 * float((squares**2).sum()), squares.size * 3).root()


def _shown(rgb: Floats, view: DisplayView) -> Doubles:
    shown = color.to_display(rgb[None], view.view, view.display, view.exposure, space=view.space)[0]
    steps: Doubles = np.clip(np.nan_to_num(shown), 0, 1).astype(np.float64) * 255
    return steps


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
class ErrorRow:
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
        found: dict[str, Any] = {"samples": self.samples, "seconds": self.seconds, "relmse": self.error.relmse.value}
        found |= {"ci95": [self.error.relmse.low, self.error.relmse.high], "rmse": self.error.rmse.value}
        return found | ({} if self.error.mix is None else {"mix": self.error.mix.as_json()})


def is_reliable(row: ErrorRow, metric: Metric) -> bool:
    """Return whether the row's error is known well enough, for its samples, to be compared with a target."""
    return row.samples >= fewest_samples(row.error.of(metric).doubt)


@dataclass(frozen=True)
class ErrorCurve:
    """All measurements, with the rate and extrapolation in one metric."""

    metric: Metric
    rows: tuple[ErrorRow, ...] = ()

    @property
    def last(self) -> ErrorRow | None:
        return self.rows[-1] if self.rows else None

    def at(self, samples: float) -> ErrorRow | None:
        """Return the last measurement if it is at exactly `samples` per pixel, else None."""
        return self.last if self.last is not None and self.last.samples == samples else None

    def add(self, row: ErrorRow) -> ErrorCurve:
        return replace(self, rows=(*self.rows, row))

    def change_last(self, row: ErrorRow) -> ErrorCurve:
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
