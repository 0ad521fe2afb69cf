"""UsdPreviewSurface.mdl, MDL's version of UsdPreviewSurface."""

from __future__ import annotations

from ..known_surfaces.record import ZERO, KnownSurface
from ..known_surfaces.reflectivity import under_coat
from .inputs import ANY, MdlInputs

AT_REST = {"occlusion": ANY, "displacement": ZERO, "opacityMode": ZERO}


def read(m: MdlInputs) -> KnownSurface:
    """Return the surface that the module's inputs describe."""
    base = m.image("diffuseColor", 3, (0.18, 0.18, 0.18), is_color=True)
    ior, coat = m.constant("ior", 1.5), m.constant("clearcoat", 0.0)
    return KnownSurface(
        base_color=m.constant("diffuseColor", 0.18, 0.18, 0.18) if base is None else base,
        base_metalness=m.constant("metallic", 0.0),
        specular_roughness=m.constant("roughness", 0.5),
        specular_ior=under_coat(m.reader, ior, coat, ior),
        coat_weight=coat,
        coat_roughness=m.constant("clearcoatRoughness", 0.01),
        coat_ior=ior,
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        emission=m.constant("emissiveColor", 0.0, 0.0, 0.0),
        opacity=m.constant("opacity", 1.0),
        cutoff=m.constant("opacityThreshold", 0.0)[0],
        normal=m.normal("normal", 1.0),
    )
