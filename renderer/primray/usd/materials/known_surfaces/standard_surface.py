"""Autodesk's standard_surface."""

from __future__ import annotations

from .record import BLACK, WHITE, ZERO, KnownSurface, Reader

SHADERS = ("ND_standard_surface_surfaceshader", "ND_standard_surface_surfaceshader_100")


def read(r: Reader) -> KnownSurface:
    r.rest(
        diffuse_roughness=ZERO,
        specular_anisotropy=ZERO,
        sheen=ZERO,
        thin_film_thickness=ZERO,
        coat_affect_color=ZERO,
        coat_affect_roughness=ZERO,
    )
    if r["transmission"] != ZERO:
        r.rest(
            transmission_depth=ZERO,
            transmission_scatter=BLACK,
            transmission_dispersion=ZERO,
            transmission_extra_roughness=ZERO,
        )
    if r["coat"] != ZERO:
        r.rest(coat_anisotropy=ZERO, coat_normal="Nworld")
    return KnownSurface(
        base_color=r.scaled("base_color", "base"),
        metalness=r["metalness"],
        specular_weight=r["specular"],
        specular_color=r["specular_color"],
        roughness=r["specular_roughness"],
        ior=r["specular_IOR"],
        transmission=r["transmission"],
        transmission_color=r["transmission_color"] if r["transmission"] != ZERO else WHITE,
        subsurface=r["subsurface"],
        subsurface_color=r["subsurface_color"],
        coat=r["coat"],
        coat_color=r["coat_color"],
        coat_roughness=r["coat_roughness"],
        coat_ior=r["coat_IOR"],
        emission=r.scaled("emission_color", "emission"),
        opacity=r.mean(r["opacity"]),
        thin_walled=r["thin_walled"],
        normal=r["normal"],
        unused=tuple(r.unused),
    )
