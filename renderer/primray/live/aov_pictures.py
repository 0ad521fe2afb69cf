"""Pictures of AOVs for the eye: light through the view transform, directions and numbers as colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..images.image import Image

if TYPE_CHECKING:
    from ..images.aov import Aov
    from ..report.prepared import Prepared

SHOWN = ("depth", "normal", "albedo", "emission", "prim", "instance", "material")
LIGHTS = ("albedo", "emission")  # shown through the view transform
LENGTHS = ("depth", "distance")
OUTLYING = 0.01  # share of the lengths at either end that the greys need not tell apart
GOLDEN = 0.6180339887498949  # of a turn of hue between a number and the next


def drawn(aov: Aov, prepared: Prepared) -> tuple[Image, npt.NDArray[np.uint8] | None]:
    """Return the picture of an AOV, as an image and, unless the view transform makes it, as it is displayed (H, W, 4)."""
    values = np.asarray(aov.values, np.float64)
    if aov.source in LIGHTS:
        rgb, shown = values, None
    else:
        rgb = (
            _of_lengths(values) if aov.source in LENGTHS else _of_numbers(values) if aov.ids is not None else 0.5 + 0.5 * values
        )
        rgb = np.where((values == 0).all(axis=2, keepdims=True), 0.0, np.clip(rgb, 0, 1))
        shown = np.concatenate([np.round(255 * rgb), np.full_like(rgb[..., :1], 255)], axis=2).astype(np.uint8)
    pixels = np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=2).astype(np.float32)
    return Image(pixels, camera=prepared.camera, frame=prepared.frame, color_space=prepared.scene.rendering_space), shown


def _of_lengths(values: Doubles) -> Doubles:
    """Return greys (H, W, 3): white is close, black is where nothing is."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros((*values.shape[:2], 3))
    near, far = np.quantile(values[known], (OUTLYING, 1 - OUTLYING))
    grey = 1 - 0.9 * np.clip((np.where(known, values, near) - near) / max(far - near, 1e-30), 0, 1)
    return np.repeat(np.where(known, grey, 0.0), 3, axis=2)


def _of_numbers(values: Doubles) -> Doubles:
    """Return colours (H, W, 3) of which neighbouring numbers have different ones."""
    hue = (values[..., 0] * GOLDEN) % 1
    turns = np.stack([hue, hue - 1 / 3, hue - 2 / 3], axis=2)
    light = 0.55 + 0.35 * ((values * GOLDEN * GOLDEN) % 1)
    made: Doubles = light * (1 - 0.75 * (0.5 + 0.5 * np.cos(2 * np.pi * turns)))
    return made
