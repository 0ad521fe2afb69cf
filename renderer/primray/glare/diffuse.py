"""Diffusion of an image by its camera's lens, with standard errors; linear, before a view's exposure, beside the record.

Images are convolved by FFT in double precision. Errors of the input's pixels are independent (each has its own samples), so
variances are summed with the squares of the kernel's weights. Errors of neighbouring output pixels are correlated, as they
share light.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from ..images.image import Image
from ..lens.diffusion import Diffusion
from .psf import PointSpreadFunction, build_psf, grid_of, starburst_aperture


def with_diffusion(image: Image) -> Image:
    """Return the image with its diffused picture and a report entry; the image itself if its lens does not diffuse."""
    if image.camera is None or image.camera.diffusion.strength == 0:
        return image
    made, says = diffuse(image, image.camera.diffusion)
    return replace(image, diffused=made, report={**image.report, "diffusion": says})


def diffuse(image: Image, diffusion: Diffusion) -> tuple[Image, dict[str, Any]]:
    """Return the diffused image and its entry in the report.

    Red, green and blue are convolved. Alpha is not: light that is scattered beside an object has no coverage.
    """
    camera, frame = image.camera, image.frame
    whole = image.resolution if frame is None else frame.resolution
    grid = grid_of(whole, image.resolution, 1.0 if frame is None else frame.pixel_aspect_ratio)
    blades = (0, 0.0) if camera is None else (camera.blades, camera.blade_rotation_deg)
    psf = build_psf(diffusion, grid, *blades)
    pixels, errors = spread_by(psf, image.pixels, image.errors)
    says = asdict(diffusion) | dict(zip(("blades", "blade_rotation_deg"), starburst_aperture(diffusion, *blades), strict=True))
    metadata = {f"diffusion.{name}": value for name, value in says.items()}
    made = Image(
        pixels=pixels,
        report={},
        metadata=metadata,
        camera=camera,
        channels=image.channels,
        errors=errors,
        color_space=image.color_space,
        frame=frame,
    )
    made = replace(made, file=image.file.beside())
    return made, says | _energy(psf, image.pixels, pixels)


def spread_by(psf: PointSpreadFunction, pixels: Floats, errors: Floats | None) -> tuple[Floats, Floats | None]:
    """Return convolved pixels (H, W, 4) and errors (H, W, 3); non-finite values stay and are not spread."""
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
    """Return the squared kernel without its middle, whose large weight is applied exactly, outside of the FFT."""
    squared: Doubles = kernel**2
    squared[kernel.shape[0] // 2, kernel.shape[1] // 2] = 0.0
    return squared


def _error(convolver: Convolver, squared: Spectrum, stays: float, stderr: Doubles) -> Doubles:
    """Return standard errors by the squared kernel; infinite everywhere if any is unknown, as its light goes everywhere."""
    if not np.isfinite(stderr).all():
        return np.full_like(stderr, np.inf)
    variance = stderr**2
    found: Doubles = np.sqrt(stays**2 * variance + convolver.spread(variance, squared))
    return found


def _energy(psf: PointSpreadFunction, before: Floats, after: Floats) -> dict[str, Any]:
    """Return the shares of light, by channel, that left their pixel and that left the image."""
    middle = tuple(side // 2 for side in psf.spread[0].shape)
    moved = [1.0 - psf.stays - float(kernel[middle]) for kernel in psf.spread]
    sums = [[float(p[..., c][np.isfinite(p[..., c])].sum(dtype=np.float64)) for c in range(3)] for p in (before, after)]
    lost = [1.0 - b / a if a > 0 else 0.0 for a, b in zip(*sums, strict=True)]
    return {"light_moved": moved, "light_lost": lost}


Spectrum = npt.NDArray[np.complex128]


class Convolver:
    """Convolution of images (H, W) with kernels (2 H - 1, 2 W - 1), with zeros outside of the image."""

    def __init__(self, height: int, width: int) -> None:
        self._size = height, width
        self._padded = fast_length(2 * height - 1), fast_length(2 * width - 1)

    def spectrum(self, kernel: Doubles) -> Spectrum:
        """Return a kernel's transform, to be used for several images."""
        height, width = self._size
        placed = np.zeros(self._padded)
        placed[: kernel.shape[0], : kernel.shape[1]] = kernel
        return np.fft.rfft2(np.roll(placed, (1 - height, 1 - width), axis=(0, 1)))

    def spread(self, picture: Doubles, spectrum: Spectrum) -> Doubles:
        """Return the convolved image; if no input is negative, no output is (rounding errors are clamped)."""
        height, width = self._size
        found: Doubles = np.fft.irfft2(np.fft.rfft2(picture, self._padded) * spectrum, self._padded)[:height, :width]
        return np.maximum(found, 0.0) if picture.min(initial=0.0) >= 0 else found


def fast_length(least: int) -> int:
    """Return the smallest product of powers of 2, 3 and 5 that is at least `least`; FFTs of such lengths are fast."""
    best = 1 << max(0, least - 1).bit_length()
    five = 1
    while five < best:
        three = five
        while three < best:
            two = three << max(0, -(-least // three) - 1).bit_length()
            best = min(best, two)
            three *= 3
        five *= 5
    return best
