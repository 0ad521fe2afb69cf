"""The Academy Software Foundation's open_pbr_surface."""

from __future__ import annotations

from .record import BLACK, WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_open_pbr_surface_surfaceshader",)


def read(r: Reader) -> KnownSurface:
    r.rest(base_diffuse_roughness=ZERO, specular_roughness_anisotropy=ZERO, fuzz_weight=ZERO, thin_film_weight=ZERO)
    if r["transmission_weight"] != ZERO:
        r.rest(transmission_depth=ZERO, transmission_scatter=BLACK, transmission_dispersion_scale=ZERO)
    if r["coat_weight"] != ZERO:
        r.rest(coat_roughness_anisotropy=ZERO, geometry_coat_normal="Nworld")
    return KnownSurface(
        base_color=r.scaled("base_color", "base_weight"),
        metalness=r["base_metalness"],
        specular_weight=r["specular_weight"],
        specular_color=r["specular_color"],
        roughness=r["specular_roughness"],
        ior=r["specular_ior"],
        transmission=r["transmission_weight"],
        transmission_color=r["transmission_color"] if r["transmission_weight"] != ZERO else WHITE,
        subsurface=r["subsurface_weight"],
        subsurface_color=r["subsurface_color"],
        coat=r["coat_weight"],
        coat_color=r["coat_color"],
        coat_roughness=r["coat_roughness"],
        coat_ior=r["coat_ior"],
        emission=r.scaled("emission_color", "emission_luminance"),
        opacity=r["geometry_opacity"],
        thin_walled=r["geometry_thin_walled"],
        normal=r["geometry_normal"],
        unused=tuple(r.unused),
    )
