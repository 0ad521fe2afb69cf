"""Weights of lights that bring a picture closest to a reference, such as a photograph, with their intervals.

Least squares over pixels, each weighed by its uncertainty. Noise of the parts would bias plain least squares towards small
weights, since it adds to the diagonal of their Gram matrix. With the two replicates A and B of each part,
N = (A'WB + B'WA) / 2 and r = ((A + B) / 2)'W y have no such term, as their noises are independent. Weights below 0 are held
at 0 by an active set (Lawson and Hanson 1974). Intervals come from residuals, summed over blocks of pixels: a sandwich
estimate, which holds where neighbouring residuals are alike, and where the lights cannot reproduce the reference.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Doubles
from ..errors import SettingsError
from ..images.image import Image
from ..images.reading import read_image
from ..sampling.error import Z95
from .mix import LightMix

BLOCK = 16  # pixels across, of residuals that may be alike
FLOOR = 0.01  # of a pixel's value, and of the mean: what no pixel of a reference is surer of
ALIKE = 0.99  # cosine between parts that no reference can tell apart


@dataclass(frozen=True)
class FittedWeight:
    """A part's weight for each channel asked for (one, or R, G and B), with the ends of their 95 % intervals."""

    value: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    @property
    def weight(self) -> tuple[float, float, float]:
        r, g, b = self.value if len(self.value) == 3 else self.value * 3
        return r, g, b


@dataclass(frozen=True)
class Fit:
    """Fitted weights by name, what they leave over, and pairs of parts that look too much alike to be told apart."""

    weights: dict[str, FittedWeight]
    residual: float  # RMS of the difference from the reference over the RMS of the reference
    alike: tuple[tuple[str, str], ...]

    def as_json(self) -> dict[str, Any]:
        rows = {name: {"weight": list(w.value), "ci95": [list(w.low), list(w.high)]} for name, w in self.weights.items()}
        return {"weights": rows, "residual": self.residual, "alike": [list(pair) for pair in self.alike]}


def fit(mix: LightMix, reference: Image | str | os.PathLike[str], *, colors: bool = False) -> Fit:
    """Return the weights of the mix's parts that bring it closest to a scene-linear picture of the same size.

    `colors`: a weight for each of R, G and B. Pixels of the reference that are not finite are left out. SettingsError if the
    sizes, windows or colour spaces differ, or no light reaches the picture. What the picture has beside its lights, such as a
    background, is taken off the reference.
    """
    wanted = reference if isinstance(reference, Image) else read_image(reference)
    if wanted.resolution != mix.image.resolution:
        own, other = ("{} x {}".format(*image.resolution) for image in (mix.image, wanted))
        sentence = f"the reference has {other} pixels and the picture {own}: fit pictures of the same size"
        raise SettingsError(sentence, where="" if isinstance(reference, Image) else os.fspath(reference), code="lights-fit")
    _check_alike(mix.image, wanted, "" if isinstance(reference, Image) else os.fspath(reference))
    left, outside = mix.beside
    y = wanted.pixels[..., :3].astype(np.float64) - outside
    lit = [part for part in mix.parts if (part.light != 0).any()]
    if not lit:
        raise SettingsError("no light reaches the picture, so there is nothing to fit", code="lights-fit")
    light = np.stack([part.light * left for part in lit])
    step = np.nan_to_num(np.stack([part.difference * left for part in lit]))
    certain = _certainty(y, np.nan_to_num(mix.image.errors) if mix.image.errors is not None else None, wanted)
    channels = [[c] for c in range(3)] if colors else [[0, 1, 2]]
    solved = [_solve(light[..., c], step[..., c], y[..., c], certain[..., c]) for c in channels]
    weights = {
        part.name: FittedWeight(
            tuple(float(w[k]) for w, _ in solved),
            tuple(float(max(w[k] - Z95 * s[k], 0.0)) for w, s in solved),
            tuple(float(w[k] + Z95 * s[k]) for w, s in solved),
        )
        for k, part in enumerate(lit)
    }
    made = np.zeros_like(y)
    for part, own in zip(lit, light, strict=True):
        made += own * weights[part.name].weight
    valid = np.isfinite(y)
    residual = float(np.sqrt(((made - y)[valid] ** 2).mean() / max((y[valid] ** 2).mean(), 1e-300)))
    return Fit(weights, residual, _alike([part.name for part in lit], light, step))


def _check_alike(own: Image, wanted: Image, where: str) -> None:
    """Raise SettingsError where the same numbers mean other colours or other places of the frame."""
    if own.color_space != wanted.color_space:
        sentence = (
            f"the reference is in the colour space {wanted.color_space.name} and the picture in {own.color_space.name}: "
            "fit pictures of the same space"
        )
        raise SettingsError(sentence, where=where, code="lights-fit")
    windows = [None if image.frame is None or image.frame.is_whole else image.frame.pixels for image in (own, wanted)]
    if None not in windows and windows[0] != windows[1]:
        sentence = "the reference and the picture are of different regions of the frame: fit pictures of the same pixels"
        raise SettingsError(sentence, where=where, code="lights-fit")


def _certainty(y: Doubles, errors: Any, wanted: Image) -> Doubles:
    """Return the weight of each value (H, W, 3): one over its variance; 0 where the reference has no value."""
    valid = np.isfinite(y)
    mean = float(np.abs(y[valid]).mean()) if valid.any() else 1.0
    variance = (FLOOR * np.where(valid, y, 0)) ** 2 + (FLOOR * mean) ** 2
    for told in (errors, wanted.errors):
        if told is not None:
            variance += _smoothed(np.nan_to_num(np.asarray(told, np.float64), posinf=0.0) ** 2)
    return np.asarray(np.where(valid, 1 / np.maximum(variance, 1e-300), 0.0))


def _smoothed(squares: Doubles) -> Doubles:
    """Return means over blocks of squared errors, which have one degree of freedom each."""
    height, width = squares.shape[:2]
    rows, columns = np.arange(0, height, BLOCK), np.arange(0, width, BLOCK)
    sums = np.add.reduceat(np.add.reduceat(squares, rows, axis=0), columns, axis=1)
    counts = np.outer(np.diff([*rows, height]), np.diff([*columns, width]))[..., None]
    found = np.repeat(np.repeat(sums / counts, BLOCK, axis=0), BLOCK, axis=1)
    return np.asarray(found[:height, :width])


def _solve(light: Doubles, step: Doubles, y: Doubles, certain: Doubles) -> tuple[Doubles, Doubles]:
    """Return weights (K,) and their standard deviations, of parts (K, H, W, C)."""
    count = len(light)
    mean, half = light.reshape(count, -1), step.reshape(count, -1)
    w, target = certain.ravel(), np.nan_to_num(y.ravel())
    # (A'WB + B'WA) / 2 with A = mean + half, B = mean - half
    gram = (mean * w) @ mean.T - (half * w) @ half.T
    found = _least_squares(gram, (mean * w) @ target)
    free = found > 0
    spread = np.zeros(count)
    if free.any():
        score = (mean * w * (target - found @ mean) + (half * w) * (found @ half)).reshape(light.shape)
        of_blocks = _block_sums(score)
        bread = np.linalg.pinv(gram[np.ix_(free, free)])
        meat = of_blocks[free] @ of_blocks[free].T
        spread[free] = np.sqrt(np.maximum(np.diag(bread @ meat @ bread.T), 0.0))
    return found, spread


def _block_sums(score: Doubles) -> Doubles:
    """Return sums (K, blocks) over blocks of pixels and over channels."""
    of_pixels = score.sum(axis=3)
    height, width = of_pixels.shape[1:]
    sums = np.add.reduceat(of_pixels, np.arange(0, height, BLOCK), axis=1)
    sums = np.add.reduceat(sums, np.arange(0, width, BLOCK), axis=2)
    return np.asarray(sums.reshape(len(score), -1))


def _least_squares(gram: Doubles, right: Doubles) -> Doubles:
    """Return the x >= 0 that minimises x'Nx / 2 - r'x (Lawson and Hanson 1974, of the normal equations)."""
    count = len(right)
    x, free = np.zeros(count), np.zeros(count, bool)
    tolerance = 1e-12 * float(np.abs(right).max() or 1.0)
    for _ in range(3 * count + 10):
        gradient = right - gram @ x
        gradient[free] = -np.inf
        if free.all() or gradient.max() <= tolerance:
            break
        free[int(gradient.argmax())] = True
        while True:
            trial = np.zeros(count)
            trial[free] = np.linalg.lstsq(gram[np.ix_(free, free)], right[free], rcond=None)[0]
            if (trial[free] > 0).all():
                x = trial
                break
            falls = free & (trial <= 0)
            share = float((x[falls] / np.maximum(x[falls] - trial[falls], 1e-300)).min())
            x = x + share * (trial - x)
            free &= x > tolerance * 1e-3
            x[~free] = 0.0
            if not free.any():
                break
    return x


def _alike(names: list[str], light: Doubles, step: Doubles) -> tuple[tuple[str, str], ...]:
    """Return pairs of parts whose pictures are nearly proportional."""
    flat, half = light.reshape(len(light), -1), step.reshape(len(step), -1)
    gram = flat @ flat.T - half @ half.T
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    cosines = gram / np.outer(size, size)
    return tuple((names[i], names[j]) for i in range(len(names)) for j in range(i) if cosines[i, j] > ALIKE)
