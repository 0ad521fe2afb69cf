"""A fibre of hair or fur: Chiang et al. 2016, with the inputs that MaterialX's chiang_hair_bsdf has."""

from __future__ import annotations

from dataclasses import dataclass

Color = tuple[float, float, float]
PREFIX = "hair_"  # of their names among a Surface's varying inputs


@dataclass(frozen=True)
class Hair:
    """Constants; what varies is named in Surface.inputs, by PREFIX and name.

    r is what is reflected, tt what passes, trt what is reflected once within.
    """

    absorption: Color = (0.0, 0.0, 0.0)  # over a way of the fibre's radius
    tint_r: Color = (1.0, 1.0, 1.0)
    tint_tt: Color = (1.0, 1.0, 1.0)
    tint_trt: Color = (1.0, 1.0, 1.0)
    variance_r: float = 0.1  # of angles along the fibre, squared radians
    variance_tt: float = 0.1
    variance_trt: float = 0.1
    scale_r: float = 0.1  # of a logistic function of angles about it, radians
    scale_tt: float = 0.1
    scale_trt: float = 0.1
    ior: float = 1.55
    cuticle_tilt: float = 0.0  # radians
