"""Conversion of each model's reflectivity and microfacet widths to OpenPBR's parameters.

Reflectivity becomes an index of refraction, weight and tint. Widths along two axes become roughness and anisotropy: alpha_t^2
+ alpha_b^2 = 2 roughness^4 and alpha_b = (1 - anisotropy) alpha_t (OpenPBR, "Microfacet model").
"""

from __future__ import annotations

import cmath
import math

from ....description import Operand
from .open_pbr import ONE, WHITE, ZERO, Reader

EDGE = 1.0 / 7.0  # the cosine at which OpenPBR's specular_color tints metals ("Metal": F82)


def normal_reflectance(ior: float) -> float:
    """Return the Fresnel reflectance at normal incidence for an index of refraction."""
    n = max(ior, 0.0)
    return ((n - 1.0) / (n + 1.0)) ** 2


def ior_for_reflectance(reflected: float) -> float:
    """Return the index of refraction for a Fresnel reflectance at normal incidence."""
    root = math.sqrt(min(max(reflected, 0.0), 0.98))
    return (1.0 + root) / (1.0 - root)


def dielectric_weight(r: Reader, weight: Operand, metalness: Operand, transmission: Operand) -> tuple[Operand, Operand]:
    """Return specular_weight and a factor of specular_color for a weight of dielectric reflections that metals ignore.

    OpenPBR's weight changes the index of refraction, so for transmissive surfaces it becomes a tint instead, which leaves
    refraction unchanged.
    """
    if weight == ONE or metalness == ONE:
        return ONE, ONE
    if transmission != ZERO:
        return ONE, r.mixed(weight, ONE, metalness)
    return r.mixed(weight, ONE, metalness), ONE


def ior_under_coat(r: Reader, ior: Operand, coat: Operand, coat_ior: Operand) -> Operand:
    """Return the index with which the base reflects under the coat as it would without one.

    Other models' coats leave the base's reflection unchanged; OpenPBR's base borders on the coat: "lerp(n_b / n_a, n_b / n_c,
    C)" ("Coat").
    """
    if coat == ZERO:
        return ior
    inverse = r.expressions.apply("ND_divide_float", in1=ONE, in2=coat_ior)
    return r.expressions.apply("ND_divide_float", in1=ior, in2=r.mixed(ONE, inverse, coat))


def metal_edge_tint(r: Reader, base: Operand, edge: Operand) -> Operand:
    """Return OpenPBR's metal edge tint for Gulbrandsen's edge colour ("Artist Friendly Metallic Fresnel", 2014).

    Constants give the conductor's exact value; varying colours a line fitted to common metals.
    """
    if edge == WHITE:
        return WHITE
    if isinstance(base, tuple) and isinstance(edge, tuple):
        return tuple(_edge_tint(f0, g) for f0, g in zip(base, edge, strict=True))
    return r.mixed_colors((0.75, 0.75, 0.75), WHITE, edge)


def _edge_tint(f0: float, g: float) -> float:
    """Return one channel of the edge tint, at most 1: OpenPBR's metal edges are never brighter than Schlick's."""
    f0, g = min(max(f0, 0.0), 0.99), min(max(g, 0.0), 1.0)
    n = g * (1.0 - f0) / (1.0 + f0) + (1.0 - g) * (1.0 + math.sqrt(f0)) / (1.0 - math.sqrt(f0))
    k = math.sqrt(max((f0 * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - f0), 0.0))
    schlick = f0 + (1.0 - f0) * (1.0 - EDGE) ** 5
    return min(_conductor(complex(n, k)) / schlick, 1.0)


def _conductor(ior: complex) -> float:
    """Return a conductor's Fresnel reflectance for unpolarised light at the cosine EDGE."""
    inside = cmath.sqrt(1.0 - (1.0 - EDGE**2) / ior**2)
    s = (EDGE - ior * inside) / (EDGE + ior * inside)
    p = (ior * EDGE - inside) / (ior * EDGE + inside)
    return (abs(s) ** 2 + abs(p) ** 2) / 2.0


_SHARPEST = (1e-8,)
_MOST = (0.98,)


def roughness_by_aspect(r: Reader, roughness: Operand, anisotropy: Operand) -> tuple[Operand, Operand]:
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


def roughness_by_strength(r: Reader, roughness: Operand, strength: Operand) -> tuple[Operand, Operand]:
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
