"""Images with their error, from the core's replicates or made of numbers whose distribution is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from primray import Image, RenderSettings, core, usd
from primray.images.reading import ERROR_CHANNELS, MeasuredImage
from primray.render import load_textures

Sample = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]  # noise of mean 0 and variance 1


class BuiltScene:
    """A stage built once, to be rendered with many seeds."""

    def __init__(self, stage: Any, settings: RenderSettings) -> None:
        from primray.diagnostics import Diagnostics

        opened = usd.open_stage(stage, Diagnostics(), settings.composition)
        description, _ = usd.translate(opened, settings)
        description, textures = load_textures(description, Diagnostics(), usd.read_asset)
        description, _ = core.dice(description, settings)
        self.exposure = description.camera.exposure_scale
        self.settings = settings
        self.scene = core.build(description, textures, settings)
        self._splits: dict[bool, core.Splits] = {}  # by whether it is a quick look

    def render(self, seed: int, spp: int) -> MeasuredImage:
        """As core.render does, but with one pilot for all seeds: it says the same each time."""
        settings = replace(self.settings, seed=seed, spp=spp)
        if settings.is_quick_look not in self._splits:
            self._splits[settings.is_quick_look] = core.choose_splits(self.scene, settings)
        film = core.Film(self.scene)
        core.render_pass(self.scene, film, core.uniform_ends(film, spp), self._splits[settings.is_quick_look], settings)
        return measured(film, self.exposure, seed)


def measured(film: Any, exposure: float, seed: int) -> MeasuredImage:
    counts = film.counts.astype(np.float64)[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        means = exposure * film.replicates[..., :3] / counts
        stderr = np.abs(means[0] - means[1]) / 2
    stderr[~np.isfinite(stderr)] = np.inf
    low, high = film.samples_per_pixel
    header = {"samples": film.samples, "samples_per_pixel": f"{low} {high}", "settings.seed": seed}
    return MeasuredImage(film.pixels[..., :3], film.pixels[..., 3], stderr.astype(np.float32), header, f"seed {seed}")


def save(image: MeasuredImage, path: Path) -> Path:
    """As `primray render` writes it."""
    planes, names = [image.pixels], ["R", "G", "B"]
    if image.alpha is not None:
        planes.append(image.alpha[..., None])
        names.append("A")
    if image.stderr is not None:
        planes.append(image.stderr)
        names.extend(ERROR_CHANNELS)
    return Image(np.concatenate(planes, axis=2), metadata=image.metadata, channels=tuple(names)).save(path)


def synthetic(
    truth: np.ndarray, noise: Sample, samples: int, rng: np.random.Generator, *, gray: bool = True, seed: int = 0
) -> MeasuredImage:
    """`truth` (H, W, 3) with noise of relative deviation 1 a sample; channels' noise is shared if `gray`."""
    shape = truth.shape[:2]
    half = samples // 2

    def replicate() -> np.ndarray:
        drawn = (*shape, 1 if gray else 3)
        mean = gaussian(rng, drawn) / half**0.5 if noise is gaussian else noise(rng, (half, *drawn)).mean(axis=0)
        return truth * (1 + mean)

    a, b = replicate(), replicate()
    header = {"samples_per_pixel": f"{samples} {samples}", "settings.seed": seed}
    stderr = np.abs(a - b) / 2
    return MeasuredImage(((a + b) / 2).astype(np.float32), None, stderr.astype(np.float32), header)


def gaussian(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return rng.standard_normal(shape)


def log_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """exp of a normal of deviation 1.5: skewness 33."""
    s = 1.5
    return (np.exp(s * rng.standard_normal(shape)) - np.exp(s * s / 2)) / np.sqrt((np.exp(s * s) - 1) * np.exp(s * s))


def spikes(rng: np.random.Generator, shape: tuple[int, ...], rate: float = 1 / 2000) -> np.ndarray:
    """A bright path once in `1 / rate` samples, nothing otherwise."""
    return ((rng.random(shape) < rate) - rate) / np.sqrt(rate * (1 - rate))
