"""A light that gives as much as is asked for: its emission times one number."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..arrays import Doubles, Floats
from ..description.lighting import Light, LightType, Photometric
from .dome_illuminance import dome_illuminance
from .flux import flux
from .illuminance import distant_illuminance, illuminance_ahead

# Shaping and images may multiply it by a thousand million before single precision ends.
BRIGHTEST = 1e15
DARK = "No emission of its shape, shaping and image gives what is asked for: it emits nothing."
TOO_BRIGHT = f"For as much as is asked for its emission would be above {BRIGHTEST:g}: it is taken as that."


def given(light: Light, wanted: Photometric, image: Floats | None = None) -> Doubles:
    """(3,) what is asked for, of an emission of 1, through an image (H, W, 3) if there is one."""
    if light.type is LightType.DOME:
        return dome_illuminance(light, wanted.up, image)
    if light.type is LightType.DISTANT:
        return distant_illuminance(light)
    if wanted.distance is not None:
        return illuminance_ahead(light, wanted.distance, image)
    all_of_it = flux(light)
    return all_of_it if image is None else np.array(all_of_it * image.mean(axis=(0, 1), dtype=np.float64))


def scaled(light: Light, wanted: Photometric, of_one: Doubles) -> Light | None:
    """With the emission that gives as much, where one of 1 gives `of_one`; None where no emission could."""
    luminance = float((of_one * light.emission) @ np.array(wanted.weights))
    if not luminance > 0 or not math.isfinite(luminance):
        return None
    r, g, b = (x * (wanted.amount / luminance) for x in light.emission)
    return replace(light, emission=(r, g, b), photometric=None)


def within(light: Light) -> Light:
    """With an emission that can be rendered."""
    r, g, b = (min(x, BRIGHTEST) for x in light.emission)
    return replace(light, emission=(r, g, b))
