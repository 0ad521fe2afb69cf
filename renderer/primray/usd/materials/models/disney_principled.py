"""Disney's principled shader, as MaterialX defines it."""

from __future__ import annotations

from ....description import Operand
from .conversions import ior_for_reflectance, ior_under_coat, normal_reflectance, roughness_by_aspect
from .open_pbr import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader
from .standard_surface import fuzz_roughness

SHADERS = ("ND_disney_principled",)
_MOST = 0.08  # reflectance at normal incidence where specular is 1
_COAT_IOR = (1.5,)
_SHEEN_ROUGHNESS = (0.3,)  # default of MaterialX's sheen_bsdf
_CALLED = {"subsurface_weight": "subsurface"}


def read(r: Reader) -> KnownSurface:
    """Return the surface that the node's inputs describe."""
    base, metal, transmission = r["baseColor"], r["metallic"], r["specTrans"]
    weight, ior = _reflectivity(r)
    roughness, anisotropy = roughness_by_aspect(r, r["roughness"], r["anisotropic"])
    _tell(r)
    return KnownSurface(
        base_color=base,
        base_metalness=metal,
        specular_weight=weight,
        specular_color=r.mixed_colors(r.mixed_colors(WHITE, base, r["specularTint"]), WHITE, metal),
        specular_roughness=roughness,
        specular_roughness_anisotropy=anisotropy,
        specular_ior=ior_under_coat(r, ior, r["clearcoat"], _COAT_IOR) if transmission == ZERO else ior,
        transmission_weight=transmission,
        transmission_color=base,
        subsurface_weight=r["subsurface"],
        subsurface_color=base,
        subsurface_radius_scale=r["subsurfaceDistance"],
        fuzz_weight=r["sheen"],
        fuzz_color=r.mixed_colors(WHITE, base, r["sheenTint"]),
        fuzz_roughness=fuzz_roughness(r, _SHEEN_ROUGHNESS),
        coat_weight=r["clearcoat"],
        coat_roughness=r.one_minus(r["clearcoatGloss"]),
        coat_ior=_COAT_IOR,
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        unused=tuple(r.unused),
        near=tuple(r.near),
        called=_CALLED,
    )


def _tell(r: Reader) -> None:
    """Record which inputs are approximated."""
    metal, transmission = r["metallic"], r["specTrans"]
    r.nearly(sheen=ZERO, clearcoat=ZERO)
    if metal == ONE:
        return
    r.nearly(specularTint=ZERO, subsurface=ZERO)  # Burley's diffusion profile is replaced by a random walk
    if transmission != ZERO:
        r.near.append("roughness")  # Disney's transmission is not roughened
    elif r["baseColor"] != BLACK and r["subsurface"] != ONE:
        r.near.append("roughness")  # Burley's diffuse lobe is brighter at grazing angles


def _reflectivity(r: Reader) -> tuple[Operand, Operand]:
    """Return specular_weight and specular_ior.

    `specular` sets the reflectance at normal incidence, independently of the index of refraction for transmission.
    """
    specular, ior = r["specular"], r["ior"]
    if r["specTrans"] != ZERO:
        said = normal_reflectance(ior[0]) / _MOST if isinstance(ior, tuple) else None
        if r["metallic"] != ONE and (said is None or not isinstance(specular, tuple) or abs(specular[0] - said) > 1e-6):
            r.near.append("specular")
        return ONE, ior
    if isinstance(specular, tuple):
        return ONE, (ior_for_reflectance(_MOST * specular[0]),)
    return r.mixed(specular, ONE, r["metallic"]), (ior_for_reflectance(_MOST),)
