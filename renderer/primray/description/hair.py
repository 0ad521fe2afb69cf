"""A fibre of hair or fur: Chiang et al. 2016, with the inputs that MaterialX's chiang_hair_bsdf has."""

from __future__ import annotations

import math
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


def hair_widths(longitudinal: float, azimuthal: float) -> dict[str, float]:
    """The variances and scales of the roughnesses beta_M and beta_N, in [0, 1] (Chiang et al. 2016, sections 4.1 and 4.2)."""
    variance = (0.726 * longitudinal + 0.812 * longitudinal**2 + 3.7 * longitudinal**20) ** 2
    scale = math.sqrt(math.pi / 8) * (0.265 * azimuthal + 1.194 * azimuthal**2 + 5.372 * azimuthal**22)
    variances = {"variance_r": variance, "variance_tt": variance / 4, "variance_trt": variance * 4}
    return variances | dict.fromkeys(("scale_r", "scale_tt", "scale_trt"), scale)


def hair_absorption(color: Color, azimuthal: float) -> Color:
    """What absorbs so much that a fibre among others has about this colour (Chiang et al. 2016, equation 9)."""
    b = azimuthal
    divisor = 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5
    r, g, b_ = ((math.log(min(max(c, 1e-5), 1.0)) / divisor) ** 2 for c in color)
    return (r, g, b_)
