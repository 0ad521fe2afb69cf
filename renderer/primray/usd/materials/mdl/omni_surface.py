"""OmniSurface, OmniSurfaceBase, OmniSurfaceLite and the OmniSurface presets (NVIDIA).

NVIDIA documents OmniSurface as "based on Autodesk Standard Surface", and it is read as one.
"""

from __future__ import annotations

from dataclasses import replace

from ....description import Operand
from ..known_surfaces import standard_surface
from ..known_surfaces.record import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader
from .inputs import ANY, MdlInputs

AT_REST = {"excludeFromWhiteMode": ANY}

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


def read(m: MdlInputs) -> KnownSurface:
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
