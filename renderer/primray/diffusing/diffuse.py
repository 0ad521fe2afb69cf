"""An image as its lens would show it, with the error of that: linear, before any exposure of a view, beside the record.

Errors of pixels are independent (each has samples of its own), so that variances add up by the squares of the kernel's weights.
Those of neighbours in the diffused picture are not, as they share light.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ..arrays import Doubles, Floats
from ..images.image import Image
from ..lens.diffusion import Diffusion
from .convolve import Convolver, Spectrum
from .grid import grid_of
from .psf import Psf, aperture_of, psf_of


def with_diffusion(image: Image) -> Image:
    """With the picture as its camera's lens diffuses it, which its report tells of; itself if the lens does not."""
    if image.camera is None or image.camera.diffusion.strength == 0:
        return image
    made, says = diffuse(image, image.camera.diffusion)
    return replace(image, diffused=made, report={**image.report, "diffusion": says})


def diffuse(image: Image, diffusion: Diffusion) -> tuple[Image, dict[str, Any]]:
    """The picture, and what a report says of it. Red, green and blue are spread, alpha stays as it is: light beside what covers
    is light without coverage.
    """
    camera, frame = image.camera, image.frame
    whole = image.resolution if frame is None else frame.resolution
    grid = grid_of(whole, image.resolution, 1.0 if frame is None else frame.pixel_aspect_ratio)
    blades = (0, 0.0) if camera is None else (camera.blades, camera.blade_rotation_deg)
    psf = psf_of(diffusion, grid, *blades)
    pixels, errors = spread_by(psf, image.pixels, image.errors)
    says = asdict(diffusion) | dict(zip(("blades", "blade_rotation_deg"), aperture_of(diffusion, *blades), strict=True))
    metadata = {f"diffusion.{name}": value for name, value in says.items()}
    made = Image(pixels, {}, metadata, camera, image.channels, errors, image.color_space, frame)
    made = replace(made, file=image.file.beside())
    return made, says | _energy(psf, image.pixels, pixels)


def spread_by(psf: Psf, pixels: Floats, errors: Floats | None) -> tuple[Floats, Floats | None]:
    """(H, W, 4) and (H, W, 3), in the form that an image has them. Values that are not finite stay and spread nothing."""
    height, width = pixels.shape[:2]
    convolver = Convolver(height, width)
    spectra: dict[int, tuple[Spectrum, Spectrum | None]] = {}
    found, told = np.array(pixels), None if errors is None else np.array(errors)
    for channel, kernel in enumerate(psf.spread):
        if id(kernel) not in spectra:
            squared = None if errors is None else convolver.spectrum(_squared_elsewhere(kernel))
            spectra = {id(kernel): (convolver.spectrum(kernel), squared)}
        spectrum, squared = spectra[id(kernel)]
        light = np.asarray(pixels[..., channel], np.float64)
        finite = np.where(np.isfinite(light), light, 0.0)
        found[..., channel] = psf.stays * light + convolver.spread(finite, spectrum)
        if told is not None and squared is not None:
            stays = psf.stays + kernel[height - 1, width - 1]
            told[..., channel] = _error(convolver, squared, stays, np.asarray(told[..., channel], np.float64))
    return found, told


def _squared_elsewhere(kernel: Doubles) -> Doubles:
    """Without the middle, which is no matter of transforms: what stays is most of all, and is to be exact."""
    squared: Doubles = kernel**2
    squared[kernel.shape[0] // 2, kernel.shape[1] // 2] = 0.0
    return squared


def _error(convolver: Convolver, squared: Spectrum, stays: float, stderr: Doubles) -> Doubles:
    """sqrt of the variances by the squared kernel; where one is unknown, so are all, as its light goes everywhere."""
    if not np.isfinite(stderr).all():
        return np.full_like(stderr, np.inf)
    variance = stderr**2
    found: Doubles = np.sqrt(stays**2 * variance + convolver.spread(variance, squared))
    return found


def _energy(psf: Psf, before: Floats, after: Floats) -> dict[str, Any]:
    """Of the picture's light: how much has left its pixel, and how much of that the picture, by channel."""
    middle = tuple(side // 2 for side in psf.spread[0].shape)
    moved = [1.0 - psf.stays - float(kernel[middle]) for kernel in psf.spread]
    sums = [[float(p[..., c][np.isfinite(p[..., c])].sum(dtype=np.float64)) for c in range(3)] for p in (before, after)]
    lost = [1.0 - b / a if a > 0 else 0.0 for a, b in zip(*sums, strict=True)]
    return {"light_moved": moved, "light_lost": lost}
