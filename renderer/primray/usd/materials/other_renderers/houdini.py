"""Houdini's principled shader, read into a KnownSurface (Houdini documentation, "Principled Shader VOP").

Solaris writes it as a shader whose source asset is the operator's definition, with only the inputs that differ from their
defaults. Textures are separate parameters: NAME_texture is read if NAME_useTexture is on, and multiplies the parameter NAME.
"""

from __future__ import annotations

from dataclasses import replace

from ....description import Operand
from ..authored import PRINCIPLED
from ..models import disney_principled
from ..models.open_pbr import NORMAL, WHITE, ZERO, KnownSurface, Reader
from ..network import Node
from . import maths
from .images import Lookup, image
from .values import ANY, RendererInputs, Vocabulary

_WRAPS = {"repeat": "periodic", "streak": "clamp", "decal": "black"}
_CHANNELS = ("r", "g", "b", "a")


def kind_of(node: Node) -> str:
    """Return PRINCIPLED for a principled shader of any version, by its id or by the operator that its source asset names."""
    if node.id.partition("::")[0] == PRINCIPLED:
        return PRINCIPLED
    if node.id:
        return ""
    return PRINCIPLED if node.shader.is_principled else ""


def _principled(n: RendererInputs) -> KnownSurface:
    r, e = n.reader, n.e
    base = _colored(n, "basecolor", (0.2, 0.2, 0.2))
    base = r.scaled(base, n.number("albedomult", 1.0))
    if n.is_on("basecolor_usePointColor", True):
        points = e.apply("ND_geompropvalue_color3", geomprop="displayColor", default=WHITE)
        base = maths.binary(e, "multiply", base, points)
    metal, transparency = _valued(n, "metallic", 0.0), _valued(n, "transparency", 0.0)
    reflect = _valued(n, "reflect", 0.5)
    inputs: dict[str, Operand] = {
        "baseColor": base,
        "metallic": metal,
        "specular": reflect,
        "specularTint": _valued(n, "reflecttint", 0.0),
        "roughness": _valued(n, "rough", 0.3),
        "anisotropic": _valued(n, "aniso", 0.0),
        "sheen": _valued(n, "sheen", 0.0),
        "sheenTint": _valued(n, "sheentint", 0.0),
        "clearcoat": _valued(n, "coat", 0.0),
        "clearcoatGloss": r.one_minus(_valued(n, "coatrough", 0.0)),
        "specTrans": transparency,
        "ior": n.constants("ior", 1.5),
        "subsurface": _valued(n, "sss", 0.0),
        "subsurfaceDistance": WHITE,
    }
    known = disney_principled.read(Reader(inputs, e))
    return _finished(n, known, transparency)


def _finished(n: RendererInputs, known: KnownSurface, transparency: Operand) -> KnownSurface:
    """Return the surface with what Disney's shader lacks: emission, opacity, transmission colour, a normal map."""
    r = n.reader
    emission = r.scaled(_colored(n, "emitcolor", (0.0, 0.0, 0.0)), _valued(n, "emitint", 1.0))
    color = n.color("ssscolor", 1.0)
    return replace(
        known,
        transmission_color=_colored(n, "transcolor", (1.0, 1.0, 1.0)),
        transmission_depth=n.number("transdist", 0.1) if transparency != ZERO and n.source("transdist") else ZERO,
        subsurface_color=known.base_color if color == WHITE else color,
        subsurface_radius=n.number("sssdist", 0.1),
        emission=emission,
        opacity=r.times(_valued(n, "opac", 1.0), r.mean(_colored(n, "opaccolor", (1.0, 1.0, 1.0)))),
        normal=_normal(n),
        near=tuple(sorted({_CALLED.get(name, name) for name in known.near})),
        called=_CALLED,
    )


_CALLED = {
    "specular": "reflect",
    "specularTint": "reflecttint",
    "roughness": "rough",
    "sheenTint": "sheentint",
    "clearcoat": "coat",
    "subsurface": "sss",
    "subsurface_weight": "sss",
}


def _colored(n: RendererInputs, name: str, default: tuple[float, float, float]) -> Operand:
    """Return a colour, times its texture if that is on."""
    own = n.color(name, *default)
    texels = _texels(n, name, is_color=True)
    if texels is None:
        return own
    color = n.e.apply("ND_convert_color4_color3", **{"in": texels})
    return maths.binary(n.e, "multiply", own, n.reader.scaled(color, n.number(f"{name}_textureIntensity", 1.0)))


def _valued(n: RendererInputs, name: str, default: float) -> Operand:
    """Return a number, times a channel of its texture if that is on."""
    own = n.number(name, default)
    texels = _texels(n, name, is_color=False)
    if texels is None:
        return own
    chosen = n.choice(f"{name}_monoChannel", _CHANNELS, "r")
    value = n.e.apply("ND_extract_color4", **{"in": texels, "index": (float(_CHANNELS.index(chosen)),)})
    return n.reader.times(own, n.reader.times(value, n.number(f"{name}_textureIntensity", 1.0)))


def _texels(n: RendererInputs, name: str, *, is_color: bool) -> Operand | None:
    on = n.is_on(f"{name}_useTexture")
    n.asked |= {f"{name}_{part}" for part in ("texture", "textureFilter", "textureFilterWidth", "udim")}
    if not on:
        own = (f"{name}_textureIntensity", f"{name}_textureWrap", f"{name}_textureColorSpace", f"{name}_monoChannel")
        n.asked |= {*own, f"{name}_sourceColorSpace"}
        return None
    return _image(n, f"{name}_texture", f"{name}_textureWrap", _space(n, name, is_color))


def _space(n: RendererInputs, name: str, is_color: bool) -> str:
    """Return the named colour space; else "auto" for colours (sRGB in integer files), and "raw" for numbers."""
    said = n.text(f"{name}_textureColorSpace") or n.text(f"{name}_sourceColorSpace")
    if said in ("", "auto", "automatic"):
        return "auto" if is_color else "raw"
    return said


def _image(n: RendererInputs, name: str, wrap: str, space: str) -> Operand:
    said = n.text(wrap, "repeat")
    if said not in _WRAPS:
        n.lost.add(wrap)
    known = _WRAPS.get(said, "periodic")
    return image(n, name, space, Lookup(wrap_s=known, wrap_t=known), (1.0, 1.0, 1.0, 1.0))


def _normal(n: RendererInputs) -> Operand:
    """Return a normal map's normal; height maps are ignored."""
    parts = ("texture", "textureWrap", "scale", "flipX", "flipY", "vectorSpace", "type", "useTexture", "space", "colorspace")
    if not n.is_on("baseBumpAndNormal_enable"):
        n.asked |= {f"baseNormal_{part}" for part in parts} | {"baseBumpAndNormal_type", "baseBump_bumpScale"}
        return NORMAL
    if n.choice("baseBumpAndNormal_type", ("bump", "normal"), "normal") == "bump":
        n.lost.add("baseBumpAndNormal_type")
        return NORMAL
    n.asked |= {"baseNormal_space", "baseNormal_colorspace", "baseNormal_useTexture", "baseNormal_type"}
    if n.source("baseNormal_texture") is None:
        return NORMAL
    e = n.e
    texels = _image(n, "baseNormal_texture", "baseNormal_textureWrap", "raw")
    coded = e.apply("ND_convert_color3_vector3", **{"in": e.apply("ND_convert_color4_color3", **{"in": texels})})
    by = n.constants("baseNormal_scale", 1.0)[0]
    scale = (-by if n.is_on("baseNormal_flipX") else by, -by if n.is_on("baseNormal_flipY") else by)
    if scale[0] == scale[1]:
        return e.apply("ND_normalmap_float", **{"in": coded, "scale": scale[:1]})
    return e.apply("ND_normalmap_vector2", **{"in": coded, "scale": scale})


NEUTRAL: dict[str, object] = {
    "frontface": ANY,
    "sssmodel": ANY,
    "sssquality": ANY,
    "sssphase": ZERO,
    "difflabel": ANY,
    "emitillum": ANY,
    "conserveenergy": ANY,
    "dispersion": ZERO,
    "anisodir": ZERO,
    "coatspecular": ANY,
    "thinwall": ZERO,
    "dispTex_enable": ZERO,
    "layer": ANY,
    "ior_label": ANY,
    "baseNormal_vectorSpace": "tangent",
}

VOCABULARY = Vocabulary("Houdini", kind_of, {PRINCIPLED: _principled}, {}, NEUTRAL)
