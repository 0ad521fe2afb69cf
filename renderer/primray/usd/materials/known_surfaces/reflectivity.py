"""How much is reflected, which each model says in its own way, in OpenPBR's: an index of refraction, a weight and a tint."""

from __future__ import annotations

import cmath
import math

from ....description import Operand
from .record import ONE, WHITE, ZERO, Reader

EDGE = 1.0 / 7.0  # the cosine at which OpenPBR's specular_color tints metals ("Metal": F82)


def head_on(ior: float) -> float:
    """What an interface reflects head-on."""
    n = max(ior, 0.0)
    return ((n - 1.0) / (n + 1.0)) ** 2


def ior_of(reflected: float) -> float:
    """The index of refraction of what reflects so much head-on."""
    root = math.sqrt(min(max(reflected, 0.0), 0.98))
    return (1.0 + root) / (1.0 - root)


def weighed(r: Reader, weight: Operand, metalness: Operand, transmission: Operand) -> tuple[Operand, Operand]:
    """specular_weight and a factor of specular_color for a weight of dielectric reflections that metals do not know.

    OpenPBR's weight goes into the index of refraction, so where light passes it is a tint instead, which leaves that alone.
    """
    if weight == ONE or metalness == ONE:
        return ONE, ONE
    if transmission != ZERO:
        return ONE, r.mixed(weight, ONE, metalness)
    return r.mixed(weight, ONE, metalness), ONE


def under_coat(r: Reader, ior: Operand, coat: Operand, coat_ior: Operand) -> Operand:
    """The index with which the base reflects under a coat as it would bare: others' coats do not change what is below.

    OpenPBR's base meets the coat: "lerp(n_b / n_a, n_b / n_c, C)" ("Coat").
    """
    if coat == ZERO:
        return ior
    inverse = r.expressions.apply("ND_divide_float", in1=ONE, in2=coat_ior)
    return r.expressions.apply("ND_divide_float", in1=ior, in2=r.mixed(ONE, inverse, coat))


def metal_edge(r: Reader, base: Operand, edge: Operand) -> Operand:
    """OpenPBR's tint of a metal's edge for Gulbrandsen's edge colour ("Artist Friendly Metallic Fresnel", 2014).

    Of constants the conductor's own value there; of what varies, a line through what common metals have.
    """
    if edge == WHITE:
        return WHITE
    if isinstance(base, tuple) and isinstance(edge, tuple):
        return tuple(_edge_tint(f0, g) for f0, g in zip(base, edge, strict=True))
    return r.mixed_colors((0.75, 0.75, 0.75), WHITE, edge)


def _edge_tint(f0: float, g: float) -> float:
    """At most 1: no edge of OpenPBR's is brighter than Schlick's."""
    f0, g = min(max(f0, 0.0), 0.99), min(max(g, 0.0), 1.0)
    n = g * (1.0 - f0) / (1.0 + f0) + (1.0 - g) * (1.0 + math.sqrt(f0)) / (1.0 - math.sqrt(f0))
    k = math.sqrt(max((f0 * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - f0), 0.0))
    schlick = f0 + (1.0 - f0) * (1.0 - EDGE) ** 5
    return min(_conductor(complex(n, k)) / schlick, 1.0)


def _conductor(ior: complex) -> float:
    """What is reflected of unpolarised light at the edge's cosine (Fresnel)."""
    inside = cmath.sqrt(1.0 - (1.0 - EDGE**2) / ior**2)
    s = (EDGE - ior * inside) / (EDGE + ior * inside)
    p = (ior * EDGE - inside) / (ior * EDGE + inside)
    return (abs(s) ** 2 + abs(p) ** 2) / 2.0
