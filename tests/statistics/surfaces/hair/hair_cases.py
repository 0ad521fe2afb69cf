"""Fibres of hair that the BSDF's tests look at."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from tests.statistics.surfaces.open_pbr.open_pbr_cases import Floats

from primray import core
from primray.core.inputs import filled


def hair_widths(longitudinal: float, azimuthal: float) -> dict[str, float]:
    """The variances and scales of the roughnesses beta_M and beta_N, in [0, 1] (Chiang et al. 2016, sections 4.1 and 4.2)."""
    variance = (0.726 * longitudinal + 0.812 * longitudinal**2 + 3.7 * longitudinal**20) ** 2
    scale = math.sqrt(math.pi / 8) * (0.265 * azimuthal + 1.194 * azimuthal**2 + 5.372 * azimuthal**22)
    variances = {"variance_r": variance, "variance_tt": variance / 4, "variance_trt": variance * 4}
    return variances | dict.fromkeys(("scale_r", "scale_tt", "scale_trt"), scale)


def hair_absorption(color: tuple[float, float, float], azimuthal: float) -> tuple[float, float, float]:
    """What absorbs so much that a fibre among others has about this colour (Chiang et al. 2016, equation 9)."""
    b = azimuthal
    divisor = 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5
    r, g, b_ = ((math.log(min(max(c, 1e-5), 1.0)) / divisor) ** 2 for c in color)
    return (r, g, b_)


CASES: dict[str, dict[str, Any]] = {
    "default": hair_widths(0.3, 0.3),
    "narrow": hair_widths(0.1, 0.15),
    "wide along": hair_widths(0.9, 0.3),
    "wide about": hair_widths(0.3, 0.9),
    "wide": hair_widths(1.0, 1.0),
    "brown": hair_widths(0.25, 0.3) | {"absorption": (0.419, 0.697, 1.37)},
    "tinted": hair_widths(0.3, 0.4) | {"tint_r": (0.5, 0.9, 1.0), "tint_tt": (1.0, 0.2, 0.4), "tint_trt": (0.1, 0.6, 1.0)},
    "tilted": hair_widths(0.2, 0.5) | {"cuticle_tilt": 0.2, "ior": 1.7},
}


def surface(case: dict[str, Any]) -> Any:
    """The core's SurfaceInput."""
    found = core.module()
    return filled(found.SurfaceInput(), lambert=False, hair=filled(found.HairInput(), **case))


def direction(inclination: float, azimuth: float) -> Floats:
    """Out of the plane across the fibre (x), and about it from the normal (z); radians."""
    c = np.cos(inclination)
    return np.array([np.sin(inclination), c * np.sin(azimuth), c * np.cos(azimuth)], np.float32)
