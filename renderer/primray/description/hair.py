"""Hair and fur fibres by Chiang et al. 2016, with the inputs of MaterialX's chiang_hair_bsdf."""

from __future__ import annotations

from dataclasses import dataclass

Color = tuple[float, float, float]
PREFIX = "hair_"  # prefix of their names among a Surface's varying inputs


@dataclass(frozen=True)
class Hair:
    """Constant inputs of the hair BSDF; varying ones are named in Surface.inputs, by PREFIX and name.

    R is reflection, TT transmission through the fibre, TRT one internal reflection.
    """

    absorption: Color = (0.0, 0.0, 0.0)  # per fibre radius
    tint_r: Color = (1.0, 1.0, 1.0)
    tint_tt: Color = (1.0, 1.0, 1.0)
    tint_trt: Color = (1.0, 1.0, 1.0)
    variance_r: float = 0.1  # longitudinal, in squared radians
    variance_tt: float = 0.1
    variance_trt: float = 0.1
    scale_r: float = 0.1  # azimuthal: scale of a logistic distribution, in radians
    scale_tt: float = 0.1
    scale_trt: float = 0.1
    ior: float = 1.55
    cuticle_tilt: float = 0.0  # radians
