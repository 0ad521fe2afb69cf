"""The stock MDL modules by file name, and the translation of a material that uses one of them.

gltf/pbr.mdl and UsdPreviewSurface.mdl are read here, NVIDIA's modules in omniverse.py.
"""

from __future__ import annotations

from collections.abc import Callable

from ....description import Operand
from ...scene.context import Context
from ..models.conversions import ior_under_coat
from ..models.open_pbr import BLACK, ONE, ZERO, KnownSurface, as_open_pbr, input_report, is_cut_out
from ..network import Node
from ..node_values import NodeValues
from ..translated_material import Material
from . import omniverse
from .inputs import ANY, MdlInputs, NeutralValues

GLTF_NEUTRAL = dict.fromkeys(("occlusion_strength", "occlusion_texture", "thickness_factor"), ANY)
_OPAQUE, _MASK, _BLEND = 0.0, 1.0, 2.0
_COAT_IOR = (1.5,)


def read_gltf(m: MdlInputs) -> KnownSurface:
    """Return the surface that the inputs of gltf/pbr.mdl describe (glTF's material in MDL)."""
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
        specular_ior=ior_under_coat(m.reader, ior, coat, _COAT_IOR) if transmission == ZERO else ior,
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


PREVIEW_SURFACE_NEUTRAL = {"occlusion": ANY, "displacement": ZERO, "opacityMode": ZERO}


def read_preview_surface(m: MdlInputs) -> KnownSurface:
    """Return the surface that the inputs of UsdPreviewSurface.mdl describe."""
    base = m.image("diffuseColor", 3, (0.18, 0.18, 0.18), is_color=True)
    ior, coat = m.constant("ior", 1.5), m.constant("clearcoat", 0.0)
    return KnownSurface(
        base_color=m.constant("diffuseColor", 0.18, 0.18, 0.18) if base is None else base,
        base_metalness=m.constant("metallic", 0.0),
        specular_roughness=m.constant("roughness", 0.5),
        specular_ior=ior_under_coat(m.reader, ior, coat, ior),
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


_Read = Callable[[MdlInputs], KnownSurface]
_MODULES: dict[str, tuple[_Read, NeutralValues]] = {
    "OmniPBR.mdl": (omniverse.read_omni_pbr, omniverse.OMNI_PBR_NEUTRAL),
    "OmniPBR_Opacity.mdl": (omniverse.read_omni_pbr, omniverse.OMNI_PBR_NEUTRAL),
    "OmniPBR_ClearCoat.mdl": (omniverse.read_omni_pbr, omniverse.OMNI_PBR_NEUTRAL),
    "OmniPBR_ClearCoat_Opacity.mdl": (omniverse.read_omni_pbr, omniverse.OMNI_PBR_NEUTRAL),
    "OmniGlass.mdl": (omniverse.read_omni_glass, omniverse.OMNI_GLASS_NEUTRAL),
    "OmniGlass_Opacity.mdl": (omniverse.read_omni_glass, omniverse.OMNI_GLASS_NEUTRAL),
    "OmniSurface.mdl": (omniverse.read_omni_surface, omniverse.OMNI_SURFACE_NEUTRAL),
    "OmniSurfaceBase.mdl": (omniverse.read_omni_surface, omniverse.OMNI_SURFACE_NEUTRAL),
    "OmniSurfaceLite.mdl": (omniverse.read_omni_surface, omniverse.OMNI_SURFACE_NEUTRAL),
    "OmniSurfaceLiteBase.mdl": (omniverse.read_omni_surface, omniverse.OMNI_SURFACE_NEUTRAL),
    "OmniSurfacePresets.mdl": (omniverse.read_omni_surface, omniverse.OMNI_SURFACE_NEUTRAL),
    "UsdPreviewSurface.mdl": (read_preview_surface, PREVIEW_SURFACE_NEUTRAL),
    "gltf/pbr.mdl": (read_gltf, GLTF_NEUTRAL),
    "pbr.mdl": (read_gltf, GLTF_NEUTRAL),
}


def mdl_material(shader: Node, path: str, ctx: Context) -> Material | None:
    """Return the material of a shader of a stock module; None where the module is not one."""
    module = shader.shader.module
    found = _MODULES.get(module) or _MODULES.get(module.rpartition("/")[2])
    if found is None:
        return None
    read, neutral = found
    inputs = MdlInputs(shader, NodeValues(ctx))
    known = read(inputs)
    surface, not_had = as_open_pbr(known, inputs.expressions, path)
    sentences = input_report((*not_had.unused, *inputs.unread(neutral)), not_had.near).sentences()
    message = f"{module.rpartition('/')[2]} is translated by its documented inputs, not interpreted. {sentences}".rstrip()
    shader.warn("mdl-material", message)
    return Material(surface, is_cut_out(known))
