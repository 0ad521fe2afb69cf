"""OmniPBR and its variants (NVIDIA, "OmniPBR Base Material")."""

from __future__ import annotations

from ....description import Operand
from ..known_surfaces.record import BLACK, ONE, WHITE, ZERO, KnownSurface
from ..known_surfaces.reflectivity import ior_of, under_coat
from .inputs import ANY, MdlInputs

AT_REST = {
    "ao_texture": ANY,
    "ao_to_diffuse": ANY,
    "project_uvw": ZERO,
    "world_or_object": ANY,  # only for projected textures
    "excludeFromWhiteMode": ANY,
}
_MOST = 0.08  # reflectance at normal incidence where specular_level is 1


def read(m: MdlInputs) -> KnownSurface:
    """Return the surface that the module's inputs describe."""
    m.st = m.set_of("uv_space_index")
    m.place("texture_translate", "texture_rotate", "texture_scale")
    roughness, metalness = _roughness_and_metalness(m)
    emission: Operand = BLACK
    if m.is_on("enable_emission"):
        color: Operand = m.constant("emissive_color", 1.0, 0.1, 0.1)
        for name in ("emissive_color_texture", "emissive_mask_texture"):
            texels = m.image(name, 3, (1.0, 1.0, 1.0), is_color=True)
            color = m.product(color, texels) if texels is not None else color
        emission = m.scaled(color, m.constant("emissive_intensity", 40.0))
    coat = m.constant("clearcoat_weight", 1.0) if m.is_on("enable_clearcoat") else ZERO
    coat_ior, tint = m.constant("clearcoat_ior", 1.56), m.constant("clearcoat_tint", *WHITE)
    ior = (ior_of(_MOST * m.constant("specular_level", 0.5)[0]),)
    others = [name for name in ("clearcoat_transparency", "clearcoat_flatten") if m.constant(name, 1.0) != ONE]
    return KnownSurface(
        base_color=_base_color(m),
        base_metalness=metalness,
        specular_roughness=roughness,
        specular_ior=under_coat(m.reader, ior, coat, coat_ior),
        coat_weight=coat,
        coat_color=tint,
        coat_roughness=m.constant("clearcoat_reflection_roughness", 0.0),
        coat_ior=coat_ior,
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        coat_normal=m.normal("clearcoat_normalmap_texture", m.constant("clearcoat_bump_factor", 1.0)[0]),
        emission=emission,
        opacity=_opacity(m),
        cutoff=m.constant("opacity_threshold", 0.0)[0],
        normal=m.normal("normalmap_texture", m.constant("bump_factor", 1.0)[0]),
        unused=() if coat == ZERO else tuple(others),
        near=() if coat == ZERO or tint == WHITE else ("clearcoat_tint",),
        called={"coat_normal": "clearcoat_normalmap_texture"},
    )


def _base_color(m: MdlInputs) -> Operand:
    texels = m.image("diffuse_texture", 3, (1.0, 1.0, 1.0), is_color=True)
    color: Operand = m.constant("diffuse_color_constant", 0.2, 0.2, 0.2)
    if texels is not None:
        color = m.scaled(texels, m.constant("albedo_brightness", 1.0))
        added = m.constant("albedo_add", 0.0)
        color = m.expressions.apply("ND_add_color3FA", in1=color, in2=added)
        grey = m.constant("albedo_desaturation", 0.0)
        if grey != (0.0,):
            kept = (1.0 - grey[0],)
            color = m.expressions.apply("ND_saturate_color3", **{"in": color, "amount": kept})
    return m.product(color, m.constant("diffuse_tint", 1.0, 1.0, 1.0))


def _roughness_and_metalness(m: MdlInputs) -> tuple[Operand, Operand]:
    roughness: Operand = m.constant("reflection_roughness_constant", 0.5)
    metalness: Operand = m.constant("metallic_constant", 0.0)
    by = m.constant("reflection_roughness_texture_influence", 0.0)[0], m.constant("metallic_texture_influence", 0.0)[0]
    if m.is_on("enable_ORM_texture"):
        packed = m.image("ORM_texture", 3, (1.0, 0.5, 0.0))
        if packed is not None:  # occlusion, roughness, metalness
            return m.mixed(roughness, m.channel(packed, 1), by[0]), m.mixed(metalness, m.channel(packed, 2), by[1])
        return roughness, metalness
    rough = m.image("reflectionroughness_texture", 1, (0.5,)) if by[0] else None
    metal = m.image("metallic_texture", 1, (0.0,)) if by[1] else None
    return m.mixed(roughness, rough, by[0]), m.mixed(metalness, metal, by[1])


def _opacity(m: MdlInputs) -> Operand:
    if not m.is_on("enable_opacity"):
        return ONE
    opacity: Operand = m.constant("opacity_constant", 1.0)
    texels = m.image("opacity_texture", 1, (1.0,)) if m.is_on("enable_opacity_texture") else None
    return opacity if texels is None else m.expressions.apply("ND_multiply_float", in1=texels, in2=opacity)
