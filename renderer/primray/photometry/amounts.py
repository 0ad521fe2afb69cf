"""Scaling of a light's emission to a photometric amount."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..arrays import Doubles, Floats
from ..description.lighting import Light, LightType, Photometric
from .flux import flux
from .illuminance import distant_illuminance, dome_illuminance, illuminance_ahead

# Shaping and images may multiply the emission by 1e9 before single precision overflows.
BRIGHTEST_EMISSION = 1e15
DARK_TEXT = "The light's shape, shaping and image let no light out, so the amount cannot be reached: it emits nothing."
TOO_BRIGHT_TEXT = f"The requested amount needs an emission above {BRIGHTEST_EMISSION:g}: it is clamped to that."


def amount_of_unit_emission(light: Light, wanted: Photometric, image: Floats | None = None) -> Doubles:
    """Return the amount (3,) that an emission of 1 gives, through an image (H, W, 3) if there is one."""
    if light.type is LightType.DOME:
        return dome_illuminance(light, wanted.up, image)
    if light.type is LightType.DISTANT:
        return distant_illuminance(light)
    if wanted.distance is not None:
        return illuminance_ahead(light, wanted.distance, image)
    all_of_it = flux(light)
    return all_of_it if image is None else np.array(all_of_it * image.mean(axis=(0, 1), dtype=np.float64))


def scaled_to(light: Light, wanted: Photometric, of_one: Doubles) -> Light | None:
    """Return the light with the wanted amount, given that an emission of 1 has the amount `of_one`; None if no scale does."""
    luminance = float((of_one * light.emission) @ np.array(wanted.weights))
    if not luminance > 0 or not math.isfinite(luminance):
        return None
    r, g, b = (x * (wanted.amount / luminance) for x in light.emission)
    return replace(light, emission=(r, g, b), photometric=None)


def clamped(light: Light) -> Light:
    """Return the light with its emission clamped to BRIGHTEST."""
    r, g, b = (min(x, BRIGHTEST_EMISSION) for x in light.emission)
    return replace(light, emission=(r, g, b))
