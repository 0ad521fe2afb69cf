"""The denoised picture of a film and its report: its error, and how much light it has lost.

It is the mean of the two film halves, each denoised separately. Denoising the whole picture at once would be about as good, but
its error could not be estimated.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import core
from ..arrays import Doubles, Floats
from ..images.image import Image
from ..settings import RenderSettings
from .denoised_error import DenoisedError, cross_half_error, halves_of
from .denoiser import Denoiser, Guides, denoiser_name

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
