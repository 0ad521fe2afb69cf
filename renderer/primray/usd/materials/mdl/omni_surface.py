"""OmniSurface, OmniSurfaceBase and OmniSurfaceLite (NVIDIA), and the inputs of OmniSurface's presets."""

from __future__ import annotations

from ....description import Operand
from ..known_surfaces.record import BLACK, ONE, KnownSurface
from .inputs import MdlInputs

AT_REST = ("excludeFromWhiteMode", "enable_diffuse_transmission", "thin_film_ior")


def read(m: MdlInputs) -> KnownSurface:
    m.place("uvw_translate", "uvw_rotate", "uvw_scale") if m.has("uvw_scale") else None
    base: Operand = m.constant("diffuse_reflection_color", 1.0, 1.0, 1.0)
    texels = m.image("diffuse_reflection_color_image", 3, (1.0, 1.0, 1.0), is_color=True)
    rough = m.image("specular_reflection_roughness_image", 1, (0.2,))
    metal = m.image("metalness_image", 1, (0.0,))
    emission: Operand = BLACK
    if m.constant("emission_weight", 0.0) != (0.0,):
        nits = m.constant("emission_weight", 0.0)[0] * m.constant("emission_intensity", 1.0)[0]
        emission = m.scaled(m.constant("emission_color", 1.0, 1.0, 1.0), (nits,))
    transmits = m.is_on("enable_specular_transmission", m.has("specular_transmission_weight"))
    return KnownSurface(
        base_color=m.scaled(base if texels is None else texels, m.constant("diffuse_reflection_weight", 0.8)),
        metalness=m.constant("metalness", 0.0) if metal is None else metal,
        specular_weight=m.constant("specular_reflection_weight", 1.0),
        specular_color=m.constant("specular_reflection_color", 1.0, 1.0, 1.0),
        roughness=m.constant("specular_reflection_roughness", 0.2) if rough is None else rough,
        ior=m.constant("specular_reflection_ior", 1.5),
        transmission=m.constant("specular_transmission_weight", 0.0) if transmits else (0.0,),
        transmission_color=m.constant("specular_transmission_color", 1.0, 1.0, 1.0),
        coat=m.constant("coat_weight", 0.0),
        coat_color=m.constant("coat_color", 1.0, 1.0, 1.0),
        coat_roughness=m.constant("coat_roughness", 0.0),
        coat_ior=m.constant("coat_ior", 1.5),
        emission=emission,
        opacity=m.constant("geometry_opacity", 1.0) if m.is_on("enable_opacity", True) else ONE,
        cutoff=m.constant("geometry_opacity_threshold", 0.0)[0],
        thin_walled=m.constant("thin_walled", 0.0),
        normal=m.normal("geometry_normal_image", m.constant("geometry_normal_strength", 1.0)[0]),
    )
