"""The error of the mean of two denoised halves, each compared with the half that it was not made of.

With p and q the denoised halves, a and b the halves as they are, R what both converge to and M = (p + q) / 2: p and b are
independent, q and a, a and b. So M^2 - p b - q a + a b is expected to be (M - R)^2, whatever the denoiser does. Comparing the
denoised halves with each other would see nothing of what both have lost.

relMSE is weighted by R^2, which nobody knows: M is drawn towards the noisy picture where the error seen around is large beside
the noise there (James and Stein 1961), since what a denoiser has smeared is worst beside its bright neighbours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..arrays import Doubles
from ..sampling.error import Z95, Estimate
from ..settings import Metric
from .halves import Halves

DARKEST = 0.01  # of relMSE: R^2 + 0.01
TILE = 4  # pixels across: what a denoiser makes of one sample goes to its neighbours
TINY = 1e-12


@dataclass(frozen=True)
class DenoisedError:
    """Of the whole frame; values are not below 0, though what they are estimated from may be."""

    relmse: Estimate
    rmse: Estimate

    def of(self, metric: Metric) -> Estimate:
        return self.rmse if metric is Metric.RMSE else self.relmse

    def as_json(self) -> dict[str, Any]:
        return {Metric.RELMSE.value: self.relmse.as_json(), Metric.RMSE.value: self.rmse.as_json()}


def cross_half_error(halves: Halves, denoised: tuple[Doubles, Doubles]) -> DenoisedError:
    """For denoised halves (H, W, 3) whose mean is the picture."""
    p, q = denoised
    mean = (p + q) / 2
    squares = mean**2 - p * halves.b - q * halves.a + halves.a * halves.b
    weights = 1 / (_level(mean, squares, halves) ** 2 + DARKEST)
    return DenoisedError(_estimate(squares * weights), _estimate(squares).root())


def _level(mean: Doubles, squares: Doubles, halves: Halves) -> Doubles:
    """What R is thought to be."""
    error = np.maximum(_around(squares), 0.0)
    noise = _around(((halves.a - halves.b) / 2) ** 2)
    made: Doubles = mean + error / (error + noise + TINY) * (halves.mean - mean)
    return made


def _around(values: Doubles) -> Doubles:
    """Means over 3 x 3 pixels."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge")
    rows = sliding_window_view(padded, 3, axis=0).mean(axis=-1)
    made: Doubles = sliding_window_view(rows, 3, axis=1).mean(axis=-1)
    return made


def _estimate(squares: Doubles) -> Estimate:
    """The mean with its interval: tiles are taken to be independent, each as uncertain as it is large."""
    by_pixel = squares.sum(axis=2)
    height, width = by_pixel.shape
    whole = np.pad(by_pixel, ((0, -height % TILE), (0, -width % TILE)))
    tiles = whole.reshape(whole.shape[0] // TILE, TILE, whole.shape[1] // TILE, TILE).sum(axis=(1, 3))
    largest = float(np.abs(tiles).max(initial=0.0)) or 1.0
    shares = (tiles / largest) ** 2
    freedom = float(shares.sum()) ** 2 / max(float((shares**2).sum()), TINY)
    step = student95(freedom) * largest * math.sqrt(float(shares.sum())) / squares.size
    value = float(squares.mean())
    return Estimate(max(value, 0.0), max(value - step, 0.0), max(value + step, 0.0))


def student95(freedom: float) -> float:
    """The quantile of Student's distribution that 95 % lie within, by Abramowitz and Stegun 26.7.5; of 2 degrees at least."""
    z, n = Z95, max(freedom, 2.0)
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
    )
    return z + sum(term / n**power for power, term in enumerate(terms, start=1))
