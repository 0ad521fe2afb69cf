"""A render of a case against the referee: mean and every pixel, in units of what the render itself says is its error.

Every seed gives a pixel two replicates, mean +- its stderr channel. Over the seeds their spread gives the pixel's error with
2 x seeds - 1 degrees of freedom; the t so found becomes the z that is as unlikely. A sum of z^2 over pixels is held against
chi-square, the largest |z| against the normal's tail, times the pixels looked at. `P_VALUE` is for each of these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from pxr import Usd
from tests.reference.adaptive import Doubles
from tests.reference.referee import Referees

from primray import RenderSettings, render

# For each of a case's three tests. A table of 100 cases in three channels so is wrong by chance once in 3000 runs.
P_VALUE = 3e-7
MEAN_TOLERANCE = 1e-3
# Of a pixel's value: what the referee itself and single precision may add to the noise.
FLOOR = 3e-5
# Of the largest pixel: dimmer ones are judged together. A part of a light that few samples find there has no own variance.
DIM = 0.03


@dataclass(frozen=True)
class Verdict:
    pixels: int
    mean_error: float  # render's mean over the referee's, less one
    mean_stderr: float  # of that, from the render
    mean_z: float
    chi_square: float  # per pixel
    log_p: float  # natural logarithm of its probability
    largest_z: float
    referee_error: float  # relative to the largest pixel
    lit: bool  # whether the referee sees any light

    def faults(self, tolerance: float = MEAN_TOLERANCE) -> list[str]:
        found = []
        if abs(self.mean_error) > tolerance + 4 * max(self.mean_stderr - tolerance / 3, 0):
            found.append(f"the mean is off by {self.mean_error:+.2e}, its own error {self.mean_stderr:.1e}")
        if abs(self.mean_z) > _z_of(P_VALUE):
            found.append(f"the mean is {self.mean_z:+.1f} standard errors off")
        if self.log_p < math.log(P_VALUE):
            found.append(f"chi-square a pixel is {self.chi_square:.2f}, p = exp({self.log_p:.0f})")
        if self.largest_z > _z_of(P_VALUE / self.pixels):
            found.append(f"a pixel is {self.largest_z:.1f} standard errors off")
        return found


def replicates(stage: Usd.Stage, spp: int, seeds: int, resolution: tuple[int, int]) -> Doubles:
    """(2 seeds, H, W, 3)"""
    out = []
    for seed in range(1, seeds + 1):
        image = render(stage, RenderSettings(spp=spp, resolution=resolution, max_depth=1, seed=seed, default_light=False))
        assert image.report["invalid_samples"] == 0
        assert image.errors is not None
        mean, error = image.pixels[..., :3].astype(float), image.errors.astype(float)
        assert np.isfinite(mean).all()
        assert np.isfinite(error).all()
        out += [mean - error, mean + error]
    return np.array(out)


def judge(stage: Usd.Stage, reference: Referees, spp: int, seeds: int) -> Verdict:
    height, width = reference.picture.shape[:2]
    of = replicates(stage, spp, seeds, (width, height))
    found = [_channel(of[..., c], reference.picture[..., c], reference.error) for c in range(3)]
    return max(found, key=lambda v: (len(v.faults()), abs(v.mean_error)))


def _channel(of: Doubles, reference: Doubles, error: float) -> Verdict:
    mean, count = of.mean(axis=0), of.shape[0]
    own = of.std(axis=0, ddof=1) / math.sqrt(count)
    top = float(reference.max())
    if top == 0:
        return Verdict(mean.size, float(mean.max() > 0), 0.0, 0.0, 0.0, 0.0, 0.0, error, False)
    sigma = np.hypot(own, FLOOR * np.maximum(reference, 0.01 * top))
    bright = reference >= DIM * top
    z = _z_from_t(((mean - reference) / sigma)[bright], count - 1)
    if not bright.all():
        dim = (mean - reference)[~bright].sum() / math.sqrt(float((sigma[~bright] ** 2).sum()))
        z = np.append(z, _z_from_t(np.array([dim]), count - 1))
    whole = math.sqrt(float((sigma**2).sum())) / reference.sum()
    deviation = float(mean.sum() / reference.sum() - 1)
    square = float((z**2).sum())
    return Verdict(
        z.size,
        deviation,
        whole,
        deviation / whole,
        square / z.size,
        _log_p_chi_square(square, z.size),
        float(np.abs(z).max()),
        error,
        True,
    )


def _z_from_t(t: Doubles, freedom: int) -> Doubles:
    """Student's t to the normal deviate with the same tail; odd degrees of freedom have a closed form (A&S 26.7.3)."""
    assert freedom % 2 == 1
    theta = np.arctan(np.abs(t) / math.sqrt(freedom))
    c, term, total = np.cos(theta), np.cos(theta), np.zeros_like(theta)
    for k in range(1, (freedom - 1) // 2 + 1):
        total = total + term
        term = term * c * c * (2 * k) / (2 * k + 1)
    tail = np.maximum(1 - (theta + np.sin(theta) * total) * 2 / math.pi, 1e-15)
    inverse = np.vectorize(NormalDist().inv_cdf, otypes=[float])
    z: Doubles = -inverse(tail / 2)
    return z


def _log_p_chi_square(square: float, freedom: int) -> float:
    """Wilson and Hilferty 1931."""
    z = ((square / freedom) ** (1 / 3) - 1 + 2 / (9 * freedom)) / math.sqrt(2 / (9 * freedom))
    if z < 5:
        return math.log(max(NormalDist().cdf(-z), 1e-300))
    return -z * z / 2 - math.log(z * math.sqrt(2 * math.pi))


def _z_of(p: float) -> float:
    return -NormalDist().inv_cdf(p / 2)
