"""What an error will cost: samples and seconds to targets, from a pilot of a few seconds of the same render.

The pilot's anchors tell how large the error is and how fast it falls; from the last one on, tiles are doubled as adaptive
sampling would (adaptive.py), each time with the factor that the pilot saw for a whole picture. Seconds are rays times the
pilot's seconds a ray, and what measuring costs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from . import core
from .adaptive import make_plan
from .error import ALL_PIXELS, Z95, Estimate
from .sampling import FIRST_ANCHOR, FIRST_PLAN, Progress, Sampling
from .settings import MAX_SPP, SAMPLE_BLOCK, Metric, RenderSettings

if TYPE_CHECKING:
    from .sampling import Row

DOUBLINGS = 20
# How uncertain (as a logarithm) the samples are: for every doubling beyond the pilot, and by how targets fall between blocks;
# and the seconds beyond that, since other work shares the machine.
PER_DOUBLING, BETWEEN_BLOCKS, OF_SPEED = 0.04, 0.04, 0.08


@dataclass(frozen=True)
class Prediction:
    """For one target: samples a pixel on average and seconds of sampling, with 95 % intervals; None beyond what is possible."""

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
    """What a pilot found, ready to answer for any target."""

    sampling: Sampling
    row: Row
    seconds_per_ray: float
    seconds_per_measurement: float

    @property
    def metric(self) -> Metric:
        return self.sampling.settings.error_metric

    def predict(self, target: float) -> Prediction:
        """Samples and seconds until the error is no larger than `target`."""
        known = self.row.error.of(self.metric)
        width = math.log(max(known.high, 1e-300) / max(known.low, 1e-300)) / (2 * Z95) if known.value > 0 else 0.0
        if self.metric is not Metric.RELMSE:
            width *= 2
        part = min(target / max(known.value, 1e-300), 1.0) ** (1 if self.metric is Metric.RELMSE else 2)
        samples, seconds = self._to(part)
        if samples > (self.sampling.settings.spp or MAX_SPP):
            return Prediction(target, None, None)
        # What a real render would have stopped at before the pilot's end.
        for row in self.sampling.rows:
            if row.error.of(self.metric).value <= target:
                samples, seconds, width = min(samples, row.samples), min(seconds, row.seconds), 0.0
        rate = self.sampling.rate()
        further = max(math.log2(samples / self.row.samples), 0.0)
        spread = math.hypot(width / rate, BETWEEN_BLOCKS, PER_DOUBLING * further)
        return Prediction(target, Estimate.around(samples, spread), Estimate.around(seconds, math.hypot(spread, OF_SPEED)))

    def _to(self, part: float) -> tuple[float, float]:
        """Samples a pixel and seconds at which the error has fallen to `part` of the pilot's."""
        film, row, rate = self.sampling.film, self.row, self.sampling.rate()
        if part >= 1:
            return row.samples, row.seconds
        if self.sampling.settings.adapts and row.samples >= FIRST_PLAN:
            plan = make_plan(film, row.error.tiles, round(row.samples), DOUBLINGS)
            samples = plan.samples_for(row.error.tiles, row.samples, part, 0.5**rate)
            added = plan.ends(math.ceil(samples))[0] - plan.begin if math.isfinite(samples) else plan.begin
        else:
            samples = math.ceil(row.samples * part ** (-1 / rate) / SAMPLE_BLOCK) * SAMPLE_BLOCK
            added = np.full(len(film.tile_rays), (samples - row.samples) / 2)
        if not math.isfinite(samples):
            return math.inf, math.inf
        each = film.tile_rays / np.maximum(film.next.sum(axis=0), 1)  # rays a sample, over a tile
        rays = float((2 * added * each).sum())
        measurements = max(math.log2(samples / row.samples), 0.0) + 2
        return samples, row.seconds + rays * self.seconds_per_ray + measurements * self.seconds_per_measurement


def run_pilot(
    scene: core.CoreScene, settings: RenderSettings, seconds: float, progress: Progress | None = None
) -> Pilot | None:
    """Sample up to the last anchor that about so many seconds allow; None where nothing can be told of the error.

    Where the first anchor alone takes more than three times as long, what there is then has to do.
    """
    samples = FIRST_ANCHOR
    uniform = replace(settings, spp=samples, time_limit_s=3 * seconds, target_error=None, adaptive=False)
    sampling = Sampling.begin(scene, uniform)
    while True:
        sampling.run(progress)
        assert sampling.stop is not None
        if sampling.stop.reason == "interrupted":
            return None
        if sampling.stop.reason == "time-limit" or 2 * sampling.seconds > seconds or 2 * samples > MAX_SPP:
            break
        samples *= 2
        sampling.settings = replace(uniform, spp=samples)
    sampling.settings = settings
    if not sampling.rows:
        return None
    before = time.perf_counter()
    sampling.film.error_sums(ALL_PIXELS, core.threads(settings))
    measuring = time.perf_counter() - before
    sampled = max(sampling.seconds - measuring * len(sampling.rows), 0.1 * sampling.seconds)
    return Pilot(sampling, sampling.rows[-1], sampled / max(sampling.film.rays, 1), measuring)


def usual_targets(pilot: Pilot) -> Sequence[float]:
    """Round targets from the pilot's error down: 1, 2 and 5 times powers of ten."""
    value = pilot.row.error.of(pilot.metric).value
    if not value > 0:
        return []
    steps = [digit * 10.0**power for power in range(math.floor(math.log10(value)), -9, -1) for digit in (5, 2, 1)]
    return [step for step in steps if step < value][:6]
