"""Diffusion of an image by its camera's lens (veiling glare, bloom, starburst), with standard errors.

The image is linear, before a view's exposure, beside the record. It is convolved by FFT in double precision with a point spread
function of unit energy: where the light of one pixel goes, in each channel. Errors of the input's pixels are independent (each
has its own samples), so variances are summed with the squares of the kernel's weights. Errors of neighbouring output pixels are
correlated, as they share light.

Veiling glare is light that is scattered far, falling with the square of the distance. It follows Stiles and Holladay's law of
disability glare, 10 E / theta^2 (Vos 1984, "Disability glare - a state of the art report"), with a plateau in the middle as in
Spencer et al. 1995, "Physically-based glare effects for digital images". Its integral diverges, so it is cut off at the frame's
size.

Bloom is a sum of Gaussians around bright pixels.

The starburst is light diffracted by the aperture, a streak perpendicular to each edge of the polygon of its blades. The
far-field pattern is the squared magnitude of the aperture's Fourier transform (Fraunhofer; Goodman, "Introduction to Fourier
Optics", 4.3) and scales with the wavelength, as in Ritschel et al. 2009, "Temporal glare".
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles, Floats
from ..lens.diffusion import Diffusion
from .image import Image

MOST_BLADES = 4096  # with more, the pattern is that of a circle


@dataclass(frozen=True, eq=False)
class PointSpreadFunction:
    """Point spread function: the share `stays` remains in its pixel, the kernels `spread` on the grid hold the rest.

    Over all pixels within reach they sum to 1 in each channel; the grid may cut off part of that.
    """

    stays: float
    spread: tuple[Doubles, Doubles, Doubles]  # the same array where channels are alike

    def whole(self, channel: int) -> Doubles:
        """Return a channel's whole kernel, with the share that stays."""
        kernel = self.spread[channel].copy()
        kernel[kernel.shape[0] // 2, kernel.shape[1] // 2] += self.stays
        return kernel


def build_psf(diffusion: Diffusion, grid: Grid, blades: int = 0, rotation_deg: float = 0.0) -> PointSpreadFunction:
    """Return the point spread function; `blades` and `rotation_deg` are those of the camera's depth of field."""
    blades, rotation_deg = starburst_aperture(diffusion, blades, rotation_deg)
    width, scale = diffusion.bloom_width * grid.height, diffusion.strength
    alike = np.zeros(grid.shape)
    if diffusion.glare:
        alike += scale * diffusion.glare * veil(grid, width)
    left = max(0.0, 1.0 - diffusion.glare - diffusion.starburst)
    if left:
        alike += scale * left * bloom(grid, width)
    spread = (alike, alike, alike)
    if diffusion.starburst:
        stars = starburst(grid, diffusion.starburst_width * grid.height, blades, rotation_deg)
        red, green, blue = (alike + scale * diffusion.starburst * star for star in stars)
        spread = (red, green, blue)
    return PointSpreadFunction(1.0 - scale, spread)


def starburst_aperture(diffusion: Diffusion, blades: int, rotation_deg: float) -> tuple[int, float]:
    """Return blades and rotation (of a corner from +X): the diffusion's own, or those of the camera's depth of field."""
    if diffusion.blades is not None:
        blades, rotation_deg = diffusion.blades, diffusion.blade_rotation_deg
    return (blades, rotation_deg) if blades < MOST_BLADES else (0, 0.0)


@dataclass(frozen=True)
class Axis:
    """Extent of a kernel along one axis, in pixels."""

    reach: int  # pixels on either side within reach: those of the whole frame, so that a crop does not change the kernel
    window: int  # pixels on either side that are needed: those of the data window
    size: float  # of a pixel, in units of its height

    @property
    def near(self) -> int:
        """Pixels on either side that are both needed and within reach."""
        return min(self.reach, self.window)


@dataclass(frozen=True)
class Grid:
    """Extent of kernels, which are arrays (2 y.window - 1, 2 x.window - 1) with the point in the middle."""

    y: Axis
    x: Axis
    height: int  # of the whole frame, of which widths are fractions

    @property
    def shape(self) -> tuple[int, int]:
        return 2 * self.y.window - 1, 2 * self.x.window - 1

    def widened(self, kernel: Doubles) -> Doubles:
        """Return a kernel of odd sides, no larger than the grid's shape, padded with zeros to that shape."""
        beyond = [((whole - side) // 2,) * 2 for whole, side in zip(self.shape, kernel.shape, strict=True)]
        return np.pad(kernel, beyond) if any(map(any, beyond)) else kernel


def grid_of(resolution: tuple[int, int], size: tuple[int, int], pixel_aspect_ratio: float = 1.0) -> Grid:
    """Return the grid for a window of `size` (width, height) pixels in a frame of `resolution`."""
    return Grid(Axis(resolution[1], size[1], 1.0), Axis(resolution[0], size[0], pixel_aspect_ratio), resolution[1])


# Pixels within CORE of the middle are averages over POINTS x POINTS points; others are evaluated at their centres.
VEIL_CORE, VEIL_POINTS = 4, 16


def veil(grid: Grid, width: float) -> Doubles:
    """Return a kernel of sum 1 over all pixels within reach; `width`, in pixels, is the radius of the plateau."""
    y, x = _veil_positions(grid.y), _veil_positions(grid.x)
    quarter = _veil_falloff(y[:, None], x[None, :], width)
    _refine_veil(quarter, grid, width)
    # Weights of the quarter in the sum of all four: elements on an axis are shared by two, the middle by all.
    weights_y, weights_x = np.full(len(y), 2.0), np.full(len(x), 2.0)
    weights_y[0] = weights_x[0] = 1.0
    quarter /= weights_y @ quarter @ weights_x
    near = quarter[: grid.y.near, : grid.x.near]
    half = np.concatenate([near[:0:-1], near])
    return grid.widened(np.concatenate([half[:, :0:-1], half], axis=1))


def _veil_positions(axis: Axis) -> Doubles:
    return np.arange(axis.reach, dtype=np.float64) * axis.size


def _veil_falloff(y: Doubles, x: Doubles, width: float) -> Doubles:
    density: Doubles = (np.hypot(y, x) + width) ** -2.0
    return density


def _refine_veil(quarter: Doubles, grid: Grid, width: float) -> None:
    within = (np.arange(VEIL_POINTS) + 0.5) / VEIL_POINTS - 0.5
    for i, j in np.ndindex(quarter[:VEIL_CORE, :VEIL_CORE].shape):
        y, x = (i + within) * grid.y.size, (j + within) * grid.x.size
        quarter[i, j] = _veil_falloff(y[:, None], x[None, :], width).mean()


# Shares and relative widths of the Gaussians: each has half the share and three times the width of the one before, so that the
# sum falls off slower than any Gaussian, as scattering does.
BLOOM_PARTS = ((4 / 7, 1.0), (2 / 7, 3.0), (1 / 7, 9.0))


def bloom(grid: Grid, width: float) -> Doubles:
    """Return a kernel of sum 1 over all pixels within reach; `width` is the narrowest standard deviation in pixels."""
    parts = [
        share * np.outer(_gaussian(grid.y, times * width), _gaussian(grid.x, times * width)) for share, times in BLOOM_PARTS
    ]
    return grid.widened(np.sum(parts, axis=0))


def _gaussian(axis: Axis, width: float) -> Doubles:
    """Return the middle (2 near - 1,) of a Gaussian that sums to 1 over (2 reach - 1) pixels."""
    edges = np.arange(axis.near) + 0.5
    scale = axis.size / (width * math.sqrt(2.0))
    inside = np.array([math.erf(edge * scale) for edge in edges])  # integral from -edge to edge
    half = np.diff(inside) / 2
    whole: Doubles = np.concatenate([half[::-1], inside[:1], half])
    return whole / math.erf((axis.reach - 0.5) * scale)


# Samples per side of the transform, and the aperture's diameter in samples: the pattern has steps of a quarter of wavelength
# over diameter, and extends to 128 wavelengths over diameter.
PATTERN_SAMPLES, APERTURE_SAMPLES = 1024, 256
PATTERN_STEP = APERTURE_SAMPLES / PATTERN_SAMPLES
GREEN_NM = 550.0
# Dominant wavelengths of Rec.709's red, green and blue under D65, and offsets of a band around each, wide enough to blur
# rings together: no channel sees a single wavelength.
CHANNELS_NM = (611.4, 549.1, 464.2)
BAND_NM = tuple(np.linspace(-36.0, 36.0, 9))


def starburst(grid: Grid, width: float, blades: int, rotation_deg: float) -> tuple[Doubles, Doubles, Doubles]:
    """Return kernels of sum 1 for red, green and blue; `width`: green's wavelength over the aperture's diameter, in pixels."""
    pattern = _pattern(blades, rotation_deg)
    red, green, blue = (_channel_kernel(pattern, grid, width, middle) for middle in CHANNELS_NM)
    return red, green, blue


def _channel_kernel(pattern: Doubles, grid: Grid, width: float, middle_nm: float) -> Doubles:
    steps = [PATTERN_STEP * width * (middle_nm + offset) / GREEN_NM for offset in BAND_NM]  # in pixels' heights
    ends_y, ends_x = (min(axis.near, math.ceil(PATTERN_SAMPLES / 2 * max(steps) / axis.size) + 2) for axis in (grid.y, grid.x))
    found = np.zeros((2 * ends_y - 1, 2 * ends_x - 1))
    for step in steps:
        rows, all_rows = _shares(grid.y, ends_y, step)
        columns, all_columns = _shares(grid.x, ends_x, step)
        found += rows @ pattern @ columns.T / (all_rows @ pattern @ all_columns)
    return grid.widened(found / len(steps))


def _shares(axis: Axis, near: int, step: float) -> tuple[Doubles, Doubles]:
    """Return each sample's share in each pixel nearer than `near`, (2 near - 1, SAMPLES), and in all pixels within reach,
    (SAMPLES,)."""
    edges = (np.arange(PATTERN_SAMPLES + 1) - PATTERN_SAMPLES / 2 - 0.5) * (step / axis.size)  # in pixels

    def below(position: npt.NDArray[Any]) -> Doubles:
        share: Doubles = np.clip((position[:, None] - edges[None, :-1]) / (edges[1] - edges[0]), 0.0, 1.0)
        return share

    borders = np.arange(2.0 * near) - (near - 0.5)
    ends = np.array([0.5 - axis.reach, axis.reach - 0.5])
    return np.diff(below(borders), axis=0), np.diff(below(ends), axis=0)[0]


@lru_cache(maxsize=4)
def _pattern(blades: int, rotation_deg: float) -> Doubles:
    """Return the pattern (SAMPLES, SAMPLES) of sum 1, centred at SAMPLES / 2, rows downwards; it is point-symmetric."""
    found: Doubles = np.abs(np.fft.fftshift(np.fft.fft2(_aperture(blades, rotation_deg)))) ** 2
    found /= found.sum()
    found.flags.writeable = False
    return found


def _aperture(blades: int, rotation_deg: float) -> Doubles:
    """Return the open share of each cell of the aperture (antialiased edges)."""
    right = np.arange(PATTERN_SAMPLES) - PATTERN_SAMPLES / 2 + 0.5
    y, x = -right[:, None], right[None, :]
    radius = APERTURE_SAMPLES / 2
    if not blades:
        inside = radius - np.hypot(y, x)
    else:
        inside = np.full((PATTERN_SAMPLES, PATTERN_SAMPLES), np.inf)
        apothem = radius * math.cos(math.pi / blades)
        for blade in range(blades):  # an edge's normal lies between two corners
            angle = math.radians(rotation_deg) + (2 * blade + 1) * math.pi / blades
            inside = np.minimum(inside, apothem - (x * math.cos(angle) + y * math.sin(angle)))
    open_share: Doubles = np.clip(inside + 0.5, 0.0, 1.0)
    return open_share


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
