"""The denoised picture of a film and its report: its error, how much light it has lost, and stopping by that error.

The picture is the mean of the two film halves, each denoised separately. Denoising the whole picture at once would be about as
good, but its error could not be estimated.

Let p and q be the denoised halves, a and b the noisy ones, R the reference that both converge to, and M = (p + q) / 2. The
pairs (p, b), (q, a) and (a, b) are independent, so the expectation of M^2 - p b - q a + a b is (M - R)^2, whatever the denoiser
does. Comparing the denoised halves with each other would miss the detail that both have lost.

relMSE is weighted by R^2, which is unknown. It is estimated from M, shrunk towards the noisy picture where the error in the
neighbourhood is large compared to the noise (James and Stein 1961), since smearing is worst next to bright pixels.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .. import core
from ..arrays import Doubles, Floats
from ..errors import SettingsError
from ..images.image import Image
from ..sampling.error import Estimate, student_quantile
from ..settings import Metric, RenderSettings, StopAt
from .denoiser import Denoiser, Guides, check_denoiser, denoiser_name

if TYPE_CHECKING:
    from ..core import CoreScene
    from ..sampling.sampling import Sampling

DARKEST = 0.01  # relMSE divides by R^2 + 0.01
TILE = 4  # pixels across; a denoiser correlates the errors of neighbouring pixels
TINY = 1e-12


@dataclass(frozen=True)
class DenoisedError:
    """Error of the whole frame. Values are clamped at 0, though the estimators may be negative."""

    relmse: Estimate
    rmse: Estimate

    def of(self, metric: Metric) -> Estimate:
        return self.rmse if metric is Metric.RMSE else self.relmse

    def as_json(self) -> dict[str, Any]:
        return {Metric.RELMSE.value: self.relmse.as_json(), Metric.RMSE.value: self.rmse.as_json()}


def cross_half_error(halves: Halves, denoised: tuple[Doubles, Doubles]) -> DenoisedError:
    """Return the error of the picture that is the mean of the denoised halves (H, W, 3)."""
    p, q = denoised
    mean = (p + q) / 2
    squares = mean**2 - p * halves.b - q * halves.a + halves.a * halves.b
    weights = 1 / (_level(mean, squares, halves) ** 2 + DARKEST)
    return DenoisedError(_estimate(squares * weights), _estimate(squares).root())


def _level(mean: Doubles, squares: Doubles, halves: Halves) -> Doubles:
    """Estimate R, the reference value of each pixel.

    The error counts by its size. Where it is negative by noise, R must not be smaller than where it is as much above 0:
    weights would then favour the negative squares, and bright specks bring an estimate of 0.
    """
    error = np.abs(_around(squares))
    noise = _around(((halves.a - halves.b) / 2) ** 2)
    made: Doubles = mean + error / (error + noise + TINY) * (halves.mean - mean)
    return made


def _around(values: Doubles) -> Doubles:
    """Return means over 3 x 3 pixels."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge")
    rows = sliding_window_view(padded, 3, axis=0).mean(axis=-1)
    made: Doubles = sliding_window_view(rows, 3, axis=1).mean(axis=-1)
    return made


def _estimate(squares: Doubles) -> Estimate:
    """Return the mean with its interval. Tiles are assumed independent, each as uncertain as it is large.

    A mean of squares is not below 0. A mean that is shows how far means here are from the truth: the interval then ends at
    least as far above 0, so that it is never empty.
    """
    by_pixel = squares.sum(axis=2)
    height, width = by_pixel.shape
    whole = np.pad(by_pixel, ((0, -height % TILE), (0, -width % TILE)))
    tiles = whole.reshape(whole.shape[0] // TILE, TILE, whole.shape[1] // TILE, TILE).sum(axis=(1, 3))
    largest = float(np.abs(tiles).max(initial=0.0)) or 1.0
    shares = (tiles / largest) ** 2
    freedom = float(shares.sum()) ** 2 / max(float((shares**2).sum()), TINY)
    step = student_quantile(freedom) * largest * math.sqrt(float(shares.sum())) / squares.size
    value = float(squares.mean())
    return Estimate(max(value, 0.0), max(value - step, 0.0), max(value + step, -value))


@dataclass(frozen=True)
class Halves:
    """Means (H, W, 3) of both replicates.

    `share` (H, W, 1) is the part of a pixel's samples in `a`: 1/2 where both have as many.
    """

    a: Doubles
    b: Doubles
    share: Doubles
    are_whole: bool  # every pixel has samples in both halves

    @property
    def mean(self) -> Doubles:
        """The picture as the film has it: the sample-weighted mean of both halves."""
        made: Doubles = self.share * self.a + (1 - self.share) * self.b
        return made


def halves_of(film: core.Film, exposure_scale: float) -> Halves:
    sums, counts = film.replicates, film.counts.astype(np.float64)[..., None]
    means = sums[..., :3] / np.maximum(counts, 1) * exposure_scale
    total = np.maximum(counts.sum(axis=0), 1)
    return Halves(means[0], means[1], counts[0] / total, bool((counts > 0).all()))


GUIDES = ("albedo", "normal")
LEAST_SHADOW = 0.002  # half an 8-bit step


@dataclass(frozen=True)
class Denoised:
    """A denoised picture (H, W, 3).

    `error` is None if some pixel has samples in one half only; the picture is then denoised as a whole.
    """

    pixels: Doubles
    error: DenoisedError | None
    energy: tuple[float, float, float] | None  # total light over that of the noisy picture, by channel; None: that has none
    seconds: float

    def as_json(self) -> dict[str, Any]:
        return {
            "by": denoiser_name(),
            "biased": True,
            "guides": list(GUIDES),
            "error": None if self.error is None else self.error.as_json(),
            "energy": None if self.energy is None else list(self.energy),
            "seconds": self.seconds,
        }


def guides_of(scene: core.CoreScene, settings: RenderSettings) -> Guides:
    """Return the guide images (albedo, normal) of a scene, which are the same for all its films."""
    found = core.first_hits(scene, [f"guide_{name}" for name in GUIDES], [], settings).planes
    return Guides(*(found[f"guide_{name}"] for name in GUIDES))


class Denoising:
    """Denoiser of one scene's films."""

    def __init__(self, guides: Guides, exposure_scale: float, settings: RenderSettings) -> None:
        self._exposure_scale = exposure_scale
        self._denoiser = Denoiser(guides, core.threads(settings))

    def of(self, film: core.Film) -> Denoised:
        start = time.perf_counter()
        halves = halves_of(film, self._exposure_scale)
        noisy = halves.mean
        if halves.are_whole:
            p, q = (np.asarray(self._denoiser.denoise(half.astype(np.float32)), np.float64) for half in (halves.a, halves.b))
            pixels, error = (p + q) / 2, cross_half_error(halves, (p, q))
        else:
            pixels, error = np.asarray(self._denoiser.denoise(noisy.astype(np.float32)), np.float64), None
        return Denoised(pixels, error, _energy(noisy, pixels), time.perf_counter() - start)


def denoised_shadow(opacity: Floats, settings: RenderSettings) -> Floats:
    """Return the opacity (H, W) of a ground's shadow without noise; values below half an 8-bit step become 0."""
    made = Denoiser(None, core.threads(settings)).denoise(np.repeat(opacity[..., None], 3, axis=2))[..., 0]
    return np.where(made < LEAST_SHADOW, 0, np.clip(made, 0, 1)).astype(np.float32)


def with_denoised(image: Image, made: Denoised) -> Image:
    """Return the image with the denoised picture beside the record, with the record's alpha, and reported."""
    says = made.as_json()
    pixels: Floats = np.concatenate([made.pixels.astype(np.float32), image.pixels[..., 3:]], axis=2)
    metadata: dict[str, str | int | float] = {"denoised.by": says["by"], "denoised.biased": 1}
    for metric, found in (says["error"] or {}).items():
        metadata |= {f"denoised.error.{metric}.estimate": found["estimate"]}
        metadata |= {f"denoised.error.{metric}.ci95": " ".join(map(str, found["ci95"]))}
    own = Image(
        pixels=pixels,
        report={},
        metadata=metadata,
        camera=image.camera,
        channels=image.channels,
        errors=None,
        color_space=image.color_space,
        frame=image.frame,
    )
    own = replace(own, file=image.file.beside())
    return replace(image, denoised=own, report={**image.report, "denoised": says})


def worse_than_record(report: Mapping[str, Any]) -> str | None:
    """Return a message if the denoised picture's relMSE exceeds that of the record by more than its uncertainty, else None."""
    denoised, record = (report["denoised"]["error"] or {}).get("relmse"), (report["error"] or {}).get("relmse")
    if denoised is None or record is None or not denoised["ci95"][0] > record["estimate"]:
        return None
    return (
        f"The denoised picture has relmse {denoised['estimate']:.3g}, but the noisy picture has {record['estimate']:.3g}: "
        "remove --denoise, or use the noisy picture (part rgba of the EXR)."
    )


def _energy(noisy: Doubles, denoised: Doubles) -> tuple[float, float, float] | None:
    before, after = noisy.sum(axis=(0, 1)), denoised.sum(axis=(0, 1))
    if not (before > 0).all():
        return None
    r, g, b = (after / before).tolist()
    return r, g, b


# The interval's upper end may be at most this many times the target; beyond that, the estimate is too uncertain.
MOST_DOUBT = 2.0


def check_denoising(settings: RenderSettings) -> None:
    """Raise SettingsError for settings that cannot be denoised. Called before rendering."""
    if not settings.denoises:
        return
    check_denoiser()
    if settings.stop_at is StopAt.DENOISED and settings.target_error is None:
        sentence = "stop_at denoised needs target_error, the error of the denoised picture to stop at"
        raise SettingsError(sentence, where="stop_at", code="denoised-target")


class DenoisedTarget:
    """A `sampling.sampling.Judge` by the denoised picture's error; caches the most recent denoised picture."""

    def __init__(self, denoising: Denoising, settings: RenderSettings) -> None:
        assert settings.target_error is not None
        self._denoising = denoising
        self._target = settings.target_error
        self._metric = settings.metric
        self._last: tuple[int, Denoised] | None = None

    def is_met(self, sampling: Sampling) -> bool:
        made = self.denoised(sampling)
        if made.error is None:
            return False
        found = made.error.of(self._metric)
        return found.value <= self._target and found.high <= MOST_DOUBT * self._target

    def denoised(self, sampling: Sampling) -> Denoised:
        """Return the denoised picture of all samples taken so far."""
        if self._last is None or self._last[0] != sampling.film.samples:
            self._last = sampling.film.samples, self._denoising.of(sampling.film)
        return self._last[1]


def denoised_target(scene: CoreScene, settings: RenderSettings) -> DenoisedTarget | None:
    """Return the stopping criterion by the denoised picture's error, or None if the settings use another."""
    if settings.stop_at is not StopAt.DENOISED or settings.target_error is None:
        return None
    return DenoisedTarget(Denoising(guides_of(scene, settings), scene.exposure_scale, settings), settings)
