"""Conversion of each model's microfacet widths along two axes to OpenPBR's roughness and anisotropy.

OpenPBR: alpha_t^2 + alpha_b^2 = 2 roughness^4 and alpha_b = (1 - anisotropy) alpha_t ("Microfacet model").
"""

from __future__ import annotations

from ....description import Operand
from .record import ONE, ZERO, Reader

_SHARPEST = (1e-8,)
_MOST = (0.98,)


def by_aspect(r: Reader, roughness: Operand, anisotropy: Operand) -> tuple[Operand, Operand]:
    """Return roughness and anisotropy for MaterialX's roughness_anisotropy.

    Its widths are roughness^2 divided and multiplied by sqrt(1 - anisotropy), the larger one at most 1.
    """
    if anisotropy == ZERO:
        return roughness, ZERO
    e = r.expressions
    narrowing = r.one_minus(e.apply("ND_clamp_float", **{"in": anisotropy, "low": ZERO, "high": _MOST}))
    aspect = e.apply("ND_sqrt_float", **{"in": narrowing})
    alpha = r.times(roughness, roughness)
    wide = e.apply("ND_min_float", in1=e.apply("ND_divide_float", in1=alpha, in2=aspect), in2=ONE)
    return _of_widths(r, wide, r.times(alpha, aspect))


def by_strength(r: Reader, roughness: Operand, strength: Operand) -> tuple[Operand, Operand]:
    """Return roughness and anisotropy for KHR_materials_anisotropy.

    The width across is roughness^2; along the tangent it is mixed with 1 by strength^2.
    """
    if strength == ZERO:
        return roughness, ZERO
    alpha = r.times(roughness, roughness)
    return _of_widths(r, r.mixed(alpha, ONE, r.times(strength, strength)), alpha)


def _of_widths(r: Reader, along: Operand, across: Operand) -> tuple[Operand, Operand]:
    """Return OpenPBR's roughness and anisotropy for the widths along and across the tangent."""
    e = r.expressions
    ratio = e.apply("ND_divide_float", in1=across, in2=e.apply("ND_max_float", in1=along, in2=_SHARPEST))
    squares = e.apply("ND_add_float", in1=r.times(along, along), in2=r.times(across, across))
    return e.apply("ND_power_float", in1=r.times(squares, (0.5,)), in2=(0.25,)), r.one_minus(ratio)
