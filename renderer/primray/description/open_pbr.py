"""OpenPBR Surface inputs, by the names in its specification, for surfaces beyond UsdPreviewSurface."""

from __future__ import annotations

from dataclasses import dataclass

Color = tuple[float, float, float]
PREFIX = "open_pbr_"  # prefix of their names among a Surface's varying inputs


@dataclass(frozen=True)
class OpenPbr:
    """Constant inputs, with the defaults of OpenPBR Surface 1.1.1; varying ones are named in Surface.inputs, by PREFIX and
    name.

    Inputs that any surface has are fields of Surface: geometry_opacity is `opacity` with `presence` (or a threshold),
    geometry_thin_walled is `thin`, the product of the emission inputs is `emissive_color` (below coat and fuzz).
    """

    base_weight: float = 1.0
    base_color: Color = (0.8, 0.8, 0.8)
    base_diffuse_roughness: float = 0.0
    base_metalness: float = 0.0
    specular_weight: float = 1.0
    specular_color: Color = (1.0, 1.0, 1.0)
    specular_roughness: float = 0.3
    specular_roughness_anisotropy: float = 0.0
    specular_ior: float = 1.5
    transmission_weight: float = 0.0
    transmission_color: Color = (1.0, 1.0, 1.0)  # surface tint, or the colour of white light after transmission_depth
    transmission_depth: float = 0.0  # world units, like subsurface_radius; 0: tinted surface without an interior
    transmission_scatter: Color = (0.0, 0.0, 0.0)  # scattering coefficient times transmission_depth
    transmission_scatter_anisotropy: float = 0.0
    transmission_dispersion_scale: float = 0.0
    transmission_dispersion_abbe_number: float = 20.0
    subsurface_weight: float = 0.0
    subsurface_color: Color = (0.8, 0.8, 0.8)
    subsurface_radius: float = 1.0
    subsurface_radius_scale: Color = (1.0, 0.5, 0.25)
    subsurface_scatter_anisotropy: float = 0.0
    fuzz_weight: float = 0.0
    fuzz_color: Color = (1.0, 1.0, 1.0)
    fuzz_roughness: float = 0.5
    coat_weight: float = 0.0
    coat_color: Color = (1.0, 1.0, 1.0)
    coat_roughness: float = 0.0
    coat_roughness_anisotropy: float = 0.0
    coat_ior: float = 1.6
    coat_darkening: float = 1.0
    coat_roughening: float = 1.0  # not in OpenPBR: how much of the coat's roughness the base takes on; 1 as in OpenPBR
    thin_film_weight: float = 0.0
    thin_film_thickness: float = 0.5  # micrometres
    thin_film_ior: float = 1.4
