"""Pictures on lights for the referee: read as floats, interpolated bilinearly between the centres of their pixels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Picture:
    pixels: Doubles  # (H, W, 3), the first row at the top, linear

    def at(self, s: Doubles, t: Doubles, wrap: bool = False) -> Doubles:
        """(..., 3) at s to the right and t down, both 0 to 1; around in s where it wraps, else clamped to the edge."""
        height, width = self.pixels.shape[:2]
        x, y = s * width - 0.5, t * height - 0.5
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        f, g = (x - i)[..., None], (y - j)[..., None]

        def texel(row: npt.NDArray[Any], column: npt.NDArray[Any]) -> Doubles:
            across = column % width if wrap else np.clip(column, 0, width - 1)
            return self.pixels[np.clip(row, 0, height - 1), across]

        above = texel(j, i) * (1 - f) + texel(j, i + 1) * f
        below = texel(j + 1, i) * (1 - f) + texel(j + 1, i + 1) * f
        return above * (1 - g) + below * g

    def lines(self, axis: int) -> Doubles:
        """Where interpolation has kinks, 0 to 1: axis 0 in t, 1 in s."""
        n = self.pixels.shape[axis]
        return (np.arange(n) + 0.5) / n


def read_picture(asset: Any) -> Picture:
    buffer = oiio.ImageBuf(asset.resolvedPath or asset.path)
    pixels = np.asarray(buffer.get_pixels(oiio.FLOAT), float)[..., :3]
    assert pixels.shape[-1] == 3, "the referee's pictures have three channels"
    return Picture(pixels)


def write_picture(path: Path, pixels: npt.ArrayLike) -> None:
    """As floats."""
    p = np.ascontiguousarray(pixels, np.float32)
    out = oiio.ImageOutput.create(str(path))
    assert out
    assert out.open(str(path), oiio.ImageSpec(p.shape[1], p.shape[0], p.shape[2], "float"))
    assert out.write_image(p)
    out.close()
