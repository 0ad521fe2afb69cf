"""Point spread function of a lens: where the light of one pixel goes, in each channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles
from ..lens.diffusion import Diffusion
from .bloom import bloom
from .glare import glare
from .grid import Grid
from .starburst import starburst

MOST_BLADES = 4096  # with more, the pattern is that of a circle


@dataclass(frozen=True, eq=False)
class Psf:
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


def psf_of(diffusion: Diffusion, grid: Grid, blades: int = 0, rotation_deg: float = 0.0) -> Psf:
    """Return the point spread function; `blades` and `rotation_deg` are those of the camera's depth of field."""
    blades, rotation_deg = aperture_of(diffusion, blades, rotation_deg)
    width, scale = diffusion.bloom_width * grid.height, diffusion.strength
    alike = np.zeros(grid.shape)
    if diffusion.glare:
        alike += scale * diffusion.glare * glare(grid, width)
    left = max(0.0, 1.0 - diffusion.glare - diffusion.starburst)
    if left:
        alike += scale * left * bloom(grid, width)
    spread = (alike, alike, alike)
    if diffusion.starburst:
        stars = starburst(grid, diffusion.starburst_width * grid.height, blades, rotation_deg)
        red, green, blue = (alike + scale * diffusion.starburst * star for star in stars)
        spread = (red, green, blue)
    return Psf(1.0 - scale, spread)


def aperture_of(diffusion: Diffusion, blades: int, rotation_deg: float) -> tuple[int, float]:
    """Return blades and rotation (of a corner from +X): the diffusion's own, or those of the camera's depth of field."""
    if diffusion.blades is not None:
        blades, rotation_deg = diffusion.blades, diffusion.blade_rotation_deg
    return (blades, rotation_deg) if blades < MOST_BLADES else (0, 0.0)
