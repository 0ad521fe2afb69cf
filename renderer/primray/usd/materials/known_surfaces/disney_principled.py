"""Disney's principled shader as MaterialX has it."""

from __future__ import annotations

from ....description import Operand
from .record import WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_disney_principled",)


def read(r: Reader) -> KnownSurface:
    r.rest(specularTint=ZERO, anisotropic=ZERO, sheen=ZERO)
    one_minus = r.expressions.apply("ND_invert_float", **{"in": r["clearcoatGloss"], "amount": (1.0,)})
    return KnownSurface(
        base_color=r["baseColor"],
        metalness=r["metallic"],
        specular_weight=r.expressions.apply("ND_multiply_float", in1=r["specular"], in2=(_f0_to_weight(r["ior"]),)),
        roughness=r["roughness"],
        ior=r["ior"],
        transmission=r["specTrans"],
        transmission_color=r["baseColor"] if r["specTrans"] != ZERO else WHITE,
        subsurface=r["subsurface"],
        subsurface_color=r["baseColor"],
        coat=r["clearcoat"],
        coat_roughness=one_minus,
        unused=tuple(r.unused),
    )


def _f0_to_weight(ior: Operand) -> float:
    """`specular` is 12.5 times what is reflected head-on (0.08 of it), whatever the ior is."""
    n = ior[0] if isinstance(ior, tuple) and ior[0] != 1.0 else 1.5
    return 0.08 / ((n - 1.0) / (n + 1.0)) ** 2
