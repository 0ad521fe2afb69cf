"""gltf/pbr.mdl: glTF's material in MDL."""

from __future__ import annotations

from ....description import Operand
from ..known_surfaces.record import BLACK, ONE, ZERO, KnownSurface
from ..known_surfaces.reflectivity import under_coat
from .inputs import MdlInputs

AT_REST = ("occlusion_strength", "occlusion_texture", "thickness_factor")
_MASK, _BLEND = 1.0, 2.0
_COAT_IOR = (1.5,)


def read(m: MdlInputs) -> KnownSurface:
    base: Operand = m.constant("base_color_factor", 1.0, 1.0, 1.0)
    texels = m.image("base_color_texture", 3, (1.0, 1.0, 1.0), is_color=True)
    base = base if texels is None else m.product(texels, base)
    packed = m.image("metallic_roughness_texture", 3, (1.0, 1.0, 1.0))
    roughness: Operand = m.constant("roughness_factor", 1.0)
    metalness: Operand = m.constant("metallic_factor", 1.0)
    if packed is not None:
        roughness = m.expressions.apply("ND_multiply_float", in1=m.channel(packed, 1), in2=roughness)
        metalness = m.expressions.apply("ND_multiply_float", in1=m.channel(packed, 2), in2=metalness)
    shining = m.image("emissive_texture", 3, (1.0, 1.0, 1.0), is_color=True)
    emission: Operand = m.constant("emissive_factor", *BLACK)
    emission = emission if shining is None else m.product(shining, emission)
    transmission = m.constant("transmission_factor", 0.0)
    mode = m.constant("alpha_mode", 0.0)[0]
    coat, ior = m.constant("clearcoat_factor", 0.0), m.constant("ior", 1.5)
    return KnownSurface(
        base_color=base,
        base_metalness=metalness,
        specular_roughness=roughness,
        specular_ior=under_coat(m.reader, ior, coat, _COAT_IOR) if transmission == ZERO else ior,
        transmission_weight=transmission,
        transmission_color=base,
        coat_weight=coat,
        coat_roughness=m.constant("clearcoat_roughness_factor", 0.0),
        coat_ior=_COAT_IOR,
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        emission=m.scaled(emission, m.constant("emissive_strength", 1.0)),
        opacity=m.constant("base_alpha", 1.0) if mode in (_MASK, _BLEND) else ONE,
        cutoff=m.constant("alpha_cutoff", 0.5)[0] if mode == _MASK else 0.0,
        normal=m.normal("normal_texture", m.constant("normal_scale_factor", 1.0)[0]),
    )
