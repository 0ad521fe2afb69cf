"""Fibres of hair that the BSDF's tests look at."""

from __future__ import annotations

from typing import Any

import numpy as np
from tests.statistics.surfaces.open_pbr.open_pbr_cases import Floats

from primray import core
from primray.core.core_inputs import filled
from primray.description.hair import hair_widths

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
