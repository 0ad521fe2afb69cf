"""Convolution of images with kernels of their own size, by FFT in double precision."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles

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
