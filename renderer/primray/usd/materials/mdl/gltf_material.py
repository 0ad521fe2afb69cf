"""gltf/pbr.mdl, glTF's material in MDL."""

from __future__ import annotations

from ....description import Operand
from ..known_surfaces.record import BLACK, ONE, ZERO, KnownSurface
from ..known_surfaces.reflectivity import under_coat
from .inputs import ANY, MdlInputs

AT_REST = dict.fromkeys(("occlusion_strength", "occlusion_texture", "thickness_factor"), ANY)
_OPAQUE, _MASK, _BLEND = 0.0, 1.0, 2.0
_COAT_IOR = (1.5,)


def read(m: MdlInputs) -> KnownSurface:
    """Return the surface that the module's inputs describe."""
    mode = m.constant("alpha_mode", _OPAQUE)[0]
    if mode not in (_OPAQUE, _MASK, _BLEND):
        m.lost.add("alpha_mode")
    base, opacity = _base_and_opacity(m, seen_through=mode in (_MASK, _BLEND))
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
    cutoff = m.constant("alpha_cutoff", 0.5)[0]
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
        opacity=opacity,
        cutoff=cutoff if mode == _MASK else 0.0,
        normal=m.normal("normal_texture", m.constant("normal_scale_factor", 1.0)[0]),
    )


def _base_and_opacity(m: MdlInputs, *, seen_through: bool) -> tuple[Operand, Operand]:
    """Return the factors times the texture's colour and alpha; opaque unless alpha_mode says otherwise.

    glTF 2.0, "Alpha Coverage".
    """
    e, factor, alpha = m.expressions, m.constant("base_color_factor", 1.0, 1.0, 1.0), m.constant("base_alpha", 1.0)
    if not seen_through:
        texels = m.image("base_color_texture", 3, (1.0, 1.0, 1.0), is_color=True)
        return (factor if texels is None else m.product(texels, factor)), ONE
    texels = m.image("base_color_texture", 4, (1.0, 1.0, 1.0, 1.0), is_color=True)
    if texels is None:
        return factor, alpha
    own = e.apply("ND_extract_color4", **{"in": texels, "index": (3.0,)})
    opacity = own if alpha == ONE else e.apply("ND_multiply_float", in1=own, in2=alpha)
    return m.product(e.apply("ND_convert_color4_color3", **{"in": texels}), factor), opacity
