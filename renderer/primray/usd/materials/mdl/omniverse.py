"""NVIDIA's MDL modules: OmniPBR with its variants, OmniGlass, and OmniSurface with its variants and presets.

OmniPBR follows NVIDIA's page "OmniPBR Base Material". OmniSurface is documented as "based on Autodesk Standard Surface", and
is read as one.
"""

from __future__ import annotations

from dataclasses import replace

from ....description import Operand
from ..models import standard_surface
from ..models.conversions import ior_for_reflectance, ior_under_coat
from ..models.open_pbr import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader
from .inputs import ANY, MdlInputs

OMNI_PBR_NEUTRAL = {
    "ao_texture": ANY,
    "ao_to_diffuse": ANY,
    "project_uvw": ZERO,
    "world_or_object": ANY,  # only for projected textures
    "excludeFromWhiteMode": ANY,
}
_MOST = 0.08  # reflectance at normal incidence where specular_level is 1


def read_omni_pbr(m: MdlInputs) -> KnownSurface:
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
    ior = (ior_for_reflectance(_MOST * m.constant("specular_level", 0.5)[0]),)
    others = [name for name in ("clearcoat_transparency", "clearcoat_flatten") if m.constant(name, 1.0) != ONE]
    return KnownSurface(
        base_color=_base_color(m),
        base_metalness=metalness,
        specular_roughness=roughness,
        specular_ior=ior_under_coat(m.reader, ior, coat, coat_ior),
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


OMNI_GLASS_NEUTRAL = {"depth": ANY, "reflection_color": (1.0, 1.0, 1.0), "excludeFromWhiteMode": ANY}


def read_omni_glass(m: MdlInputs) -> KnownSurface:
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


OMNI_SURFACE_NEUTRAL = {"excludeFromWhiteMode": ANY}

# OmniSurface's names for standard_surface's inputs, and its defaults.
_INPUTS: dict[str, tuple[str, tuple[float, ...]]] = {
    "base": ("diffuse_reflection_weight", (0.8,)),
    "base_color": ("diffuse_reflection_color", WHITE),
    "diffuse_roughness": ("diffuse_reflection_roughness", ZERO),
    "metalness": ("metalness", ZERO),
    "specular": ("specular_reflection_weight", ONE),
    "specular_color": ("specular_reflection_color", WHITE),
    "specular_roughness": ("specular_reflection_roughness", (0.2,)),
    "specular_IOR": ("specular_reflection_ior", (1.5,)),
    "specular_anisotropy": ("specular_reflection_anisotropy", ZERO),
    "specular_rotation": ("specular_reflection_anisotropy_rotation", ZERO),
    "transmission": ("specular_transmission_weight", ZERO),
    "transmission_color": ("specular_transmission_color", WHITE),
    "transmission_depth": ("specular_transmission_scattering_depth", ZERO),
    "transmission_scatter": ("specular_transmission_scattering_color", BLACK),
    "transmission_scatter_anisotropy": ("specular_transmission_scatter_anisotropy", ZERO),
    "transmission_dispersion": ("specular_transmission_dispersion_abbe", ZERO),
    "subsurface": ("subsurface_weight", ZERO),
    "subsurface_color": ("subsurface_transmission_color", WHITE),
    "subsurface_radius": ("subsurface_scattering_color", WHITE),
    "subsurface_scale": ("subsurface_scale", ONE),
    "subsurface_anisotropy": ("subsurface_anisotropy", ZERO),
    "sheen": ("specular_retro_reflection_weight", ZERO),
    "sheen_color": ("specular_retro_reflection_color", WHITE),
    "sheen_roughness": ("specular_retro_reflection_roughness", (0.3,)),
    "coat": ("coat_weight", ZERO),
    "coat_color": ("coat_color", WHITE),
    "coat_roughness": ("coat_roughness", (0.1,)),
    "coat_anisotropy": ("coat_anisotropy", ZERO),
    "coat_rotation": ("coat_anisotropy_rotation", ZERO),
    "coat_IOR": ("coat_ior", (1.5,)),
    "coat_affect_color": ("coat_affect_color", ZERO),
    "coat_affect_roughness": ("coat_affect_roughness", ZERO),
    "thin_film_thickness": ("thin_film_thickness", (400.0,)),
    "thin_film_IOR": ("thin_film_ior", (1.52,)),
    "emission_color": ("emission_color", WHITE),
    "thin_walled": ("thin_walled", ZERO),
}
_IMAGES = {"base_color": 3, "specular_roughness": 1, "metalness": 1}  # inputs with a texture, and its number of channels


def read_omni_surface(m: MdlInputs) -> KnownSurface:
    """Return the surface that the module's inputs describe."""
    placed = "uvw_translate", "uvw_rotate", "uvw_scale"
    m.read.update(placed)
    if any(m.has(name) for name in placed):
        m.place(*placed)
    inputs: dict[str, Operand] = {name: m.constant(own, *default) for name, (own, default) in _INPUTS.items()}
    for name, width in _IMAGES.items():
        own, default = _INPUTS[name]
        texels = m.image(f"{own}_image", width, default, is_color=width == 3)
        inputs[name] = inputs[name] if texels is None else texels
    inputs |= {
        "transmission_extra_roughness": ZERO,
        "emission": (m.constant("emission_weight", 0.0)[0] * m.constant("emission_intensity", 1.0)[0],),
        "opacity": WHITE,
        "tangent": "Tworld",
        "normal": m.normal("geometry_normal_image", m.constant("geometry_normal_strength", 1.0)[0]),
    }
    inputs["coat_normal"] = m.normal("coat_normal_image", 1.0) if m.has("coat_normal_image") else inputs["normal"]
    _switch_off(m, inputs)
    known = standard_surface.read(Reader(inputs, m.expressions))
    return replace(
        known,
        opacity=m.constant("geometry_opacity", 1.0) if m.is_on("enable_opacity", True) else ONE,
        cutoff=m.constant("geometry_opacity_threshold", 0.0)[0],
        unused=_named(known.unused),
        near=_named(known.near),
        called={name: _name(standards) for name, standards in known.called.items()},
    )


def _switch_off(m: MdlInputs, inputs: dict[str, Operand]) -> None:
    """Set the weights of disabled lobes to zero; a lobe whose weight is authored without its switch is on."""
    switches = {
        "transmission": ("enable_specular_transmission", m.has("specular_transmission_weight")),
        "subsurface": ("enable_diffuse_transmission", m.has("subsurface_weight")),
        "thin_film_thickness": ("enable_thin_film", False),
    }
    for name, (switch, default) in switches.items():
        if not m.is_on(switch, default):
            inputs[name] = ZERO


def _name(standards: str) -> str:
    return _INPUTS[standards][0] if standards in _INPUTS else standards


def _named(standards: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(_name(name) for name in standards)
