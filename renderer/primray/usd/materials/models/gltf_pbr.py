"""Khronos' gltf_pbr, read after its MaterialX node graph."""

from __future__ import annotations

import math

from ....description import Operand
from .conversions import dielectric_weight, ior_for_reflectance, ior_under_coat, normal_reflectance, roughness_by_strength
from .open_pbr import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader
from .standard_surface import fuzz_roughness

SHADERS = ("ND_gltf_pbr_surfaceshader",)
_OPAQUE, _MASK = (0.0,), (1.0,)
_COAT_IOR = (1.5,)
_ABBE = 20.0  # KHR_materials_dispersion: dispersion = 20 / V
_CALLED = {"transmission_depth": "attenuation_distance", "coat_normal": "clearcoat_normal"}


def read(r: Reader) -> KnownSurface:
    """Return the surface that the node's inputs describe."""
    metal, transmission, coat = r["metallic"], r["transmission"], r["clearcoat"]
    ior, tint = _reflectivity(r)
    weight, factor = dielectric_weight(r, r["specular"], metal, transmission)
    roughness, anisotropy = roughness_by_strength(r, r["roughness"], r["anisotropy_strength"])
    sheen, sheen_color = _sheen(r)
    _tell(r)
    color, depth = _attenuation(r)
    scale, abbe = _dispersion(r)
    return KnownSurface(
        base_color=r["base_color"],
        base_metalness=metal,
        specular_weight=weight,
        specular_color=r.mixed_colors(r.scaled(tint, factor), WHITE, metal),
        specular_roughness=roughness,
        specular_roughness_anisotropy=anisotropy,
        specular_ior=ior_under_coat(r, ior, coat, _COAT_IOR) if transmission == ZERO else ior,
        transmission_weight=transmission,
        transmission_color=color,
        transmission_depth=depth,
        transmission_dispersion_scale=scale,
        transmission_dispersion_abbe_number=abbe,
        fuzz_weight=sheen,
        fuzz_color=sheen_color,
        fuzz_roughness=fuzz_roughness(r, r.times(r["sheen_roughness"], r["sheen_roughness"])),
        coat_weight=coat,
        coat_roughness=r["clearcoat_roughness"],
        coat_ior=_COAT_IOR,
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        thin_film_weight=r["iridescence"],
        thin_film_thickness=r.times(r["iridescence_thickness"], (0.001,)),
        thin_film_ior=r["iridescence_ior"],
        emission=r.scaled(r["emissive"], r["emissive_strength"]),
        opacity=ONE if r["alpha_mode"] == _OPAQUE else r["alpha"],
        cutoff=_cutoff(r),
        normal=r["normal"],
        tangent=r.turned(r["tangent"], r["normal"], r.times(r["anisotropy_rotation"], (-180.0 / math.pi,))),
        coat_normal=r["clearcoat_normal"],
        unused=tuple(r.unused),
        near=tuple(r.near),
        called=_CALLED,
    )


def _tell(r: Reader) -> None:
    """Record which inputs are approximated."""
    metal = r["metallic"]
    r.nearly(sheen_color=BLACK)
    if metal != ONE:
        if r["specular"] != ZERO or r["transmission"] != ZERO:
            r.nearly(specular=ONE)
        if r["clearcoat"] != ZERO and r["transmission"] != ZERO:
            r.near.append("clearcoat")


def _cutoff(r: Reader) -> float:
    cutoff = r["alpha_cutoff"]
    return max(cutoff[0], 1e-6) if r["alpha_mode"] == _MASK and isinstance(cutoff, tuple) else 0.0


def _reflectivity(r: Reader) -> tuple[Operand, Operand]:
    """Return specular_ior and a tint.

    specular_color scales only the reflectance at normal incidence, so a grey one is equivalent to another index of refraction.
    """
    ior, color = r["ior"], r["specular_color"]
    if r["metallic"] == ONE or color == WHITE:
        return ior, WHITE
    if not isinstance(color, tuple) or not isinstance(ior, tuple):
        r.near.append("specular_color")
        return ior, color
    most = max(color)
    if min(color) < most or most <= 0 or r["transmission"] != ZERO:
        r.near.append("specular_color")
    if r["transmission"] != ZERO:
        return ior, color
    tint = tuple(x / most for x in color) if most > 0 else WHITE
    return (ior_for_reflectance(min(normal_reflectance(ior[0]) * most, 1.0)),), tint


def _sheen(r: Reader) -> tuple[Operand, Operand]:
    """Return a fuzz weight, and a colour whose brightest channel is 1."""
    color, e = r["sheen_color"], r.expressions
    if color == BLACK:
        return ZERO, WHITE
    red, green, blue = (e.apply("ND_extract_color3", **{"in": color, "index": (float(i),)}) for i in range(3))
    most = e.apply("ND_max_float", in1=e.apply("ND_max_float", in1=red, in2=green), in2=blue)
    divisor = e.apply("ND_max_float", in1=most, in2=(1e-6,))
    return most, e.apply("ND_divide_color3FA", in1=color, in2=divisor)


def _attenuation(r: Reader) -> tuple[Operand, Operand]:
    """Return the transmission colour and its depth; without a depth, the base colour tints transmitted light."""
    distance, color = r.inputs.get("attenuation_distance"), r["attenuation_color"]
    if r["thickness"] == ZERO or distance is None or distance == ZERO or color == WHITE:
        return r["base_color"], ZERO
    if r["base_color"] == WHITE:
        return color, distance
    if r["transmission"] != ZERO:
        r.unused.append("attenuation_distance")
    return r["base_color"], ZERO


def _dispersion(r: Reader) -> tuple[Operand, Operand]:
    """Return OpenPBR's dispersion scale and Abbe number."""
    value = r["dispersion"]
    if isinstance(value, tuple) and value[0] > 1.0:
        return ONE, (_ABBE / value[0],)
    return value, (_ABBE,)
