"""Khronos' gltf_pbr."""

from __future__ import annotations

from ....description import Operand
from .record import WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_gltf_pbr_surfaceshader",)
_OPAQUE, _MASK, _BLEND = (0.0,), (1.0,), (2.0,)


def read(r: Reader) -> KnownSurface:
    r.rest(sheen_color=(0.0, 0.0, 0.0), iridescence=ZERO, anisotropy_strength=ZERO, dispersion=ZERO)
    if r["transmission"] != ZERO:
        r.rest(thickness=ZERO)
    if r["clearcoat"] != ZERO:
        r.rest(clearcoat_normal="Nworld")
    mode, cutoff = r["alpha_mode"], r["alpha_cutoff"]
    opacity: Operand = (1.0,) if mode == _OPAQUE else r["alpha"]
    return KnownSurface(
        base_color=r["base_color"],
        metalness=r["metallic"],
        specular_weight=r["specular"],
        specular_color=r["specular_color"],
        roughness=r["roughness"],
        ior=r["ior"],
        transmission=r["transmission"],
        transmission_color=r["base_color"] if r["transmission"] != ZERO else WHITE,
        coat=r["clearcoat"],
        coat_roughness=r["clearcoat_roughness"],
        emission=r.scaled("emissive", "emissive_strength"),
        opacity=opacity,
        cutoff=max(cutoff[0], 1e-6) if mode == _MASK and isinstance(cutoff, tuple) else 0.0,
        normal=r["normal"],
        unused=tuple(r.unused),
    )
