"""OmniGlass (NVIDIA)."""

from __future__ import annotations

from ..known_surfaces.record import ONE, KnownSurface
from .inputs import ANY, MdlInputs

AT_REST = {"depth": ANY, "reflection_color": (1.0, 1.0, 1.0), "excludeFromWhiteMode": ANY}


def read(m: MdlInputs) -> KnownSurface:
    """Return the surface that the module's inputs describe."""
    return KnownSurface(
        base_color=(1.0, 1.0, 1.0),
        transmission_weight=ONE,
        transmission_color=m.constant("glass_color", 1.0, 1.0, 1.0),
        specular_ior=m.constant("glass_ior", 1.491),
        specular_roughness=m.constant("frosting_roughness", 0.0),
        thin_walled=m.constant("thin_walled", 0.0),
        normal=m.normal("normal_map_texture", m.constant("normal_map_strength", 1.0)[0]),
    )
