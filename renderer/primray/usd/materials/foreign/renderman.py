"""RenderMan's surfaces, each read into a KnownSurface (RenderMan documentation: PxrSurface, PxrDisneyBsdf, PxrDisney).

PxrSurface adds up lobes, each with its own gain and reflectivity; here they become the lobes of one layered surface, so that
most of its inputs are approximated, and reported as such.
"""

from __future__ import annotations

from dataclasses import replace

from ....description import Operand
from ..known_surfaces import disney_principled
from ..known_surfaces.record import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader
from ..known_surfaces.reflectivity import head_on, ior_of
from ..network import Node
from . import maths
from .renderman_nodes import NODES
from .values import ANY, ForeignInputs, Vocabulary

_MOST_DIELECTRIC = 0.08  # greatest reflectance at normal incidence of a dielectric
_METALLIC = 0.5  # least reflectance at normal incidence of a metal


def kind_of(node: Node) -> str:
    """Return a shader's name without the version of Houdini's own nodes ("PxrSurface::3.0"), "" where it is not RenderMan's."""
    name = node.id.partition("::")[0]
    return name if name.startswith("Pxr") and name[3:4].isupper() else ""


def _surface(n: ForeignInputs) -> KnownSurface:
    r, glass = n.reader, n.number("refractionGain", 0.0)
    diffuse_gain, diffuse = n.number("diffuseGain", 1.0), n.color("diffuseColor", 0.18)
    face = _reflected(n, "specular")
    dark = diffuse_gain == ZERO or diffuse == BLACK
    metal = _metalness(n, face, dark)
    weight, tint, ior = _dielectric(n, face)
    glassy = glass != ZERO
    coat = _reflected(n, "clearcoat")
    if glassy:
        n.near |= {"refractionGain"}
        weight, tint, ior = ONE, WHITE, n.number("glassIor", 1.5)
    scattered = n.number("subsurfaceGain", 0.0)
    _note_lobes(n)
    body = r.scaled(diffuse, diffuse_gain)
    return KnownSurface(
        base_color=face if metal == ONE else r.mixed_colors(body, face, metal),
        base_diffuse_roughness=n.number("diffuseRoughness", 0.0),
        base_metalness=metal,
        specular_weight=r.mixed(weight, ONE, metal),
        specular_color=r.mixed_colors(tint, WHITE, metal),
        specular_roughness=n.number("glassRoughness", 0.1) if glassy else n.number("specularRoughness", 0.2),
        specular_roughness_anisotropy=n.number("specularAnisotropy", 0.0),
        specular_ior=ior,
        transmission_weight=glass,
        transmission_color=n.color("refractionColor", 1.0),
        subsurface_weight=scattered,
        subsurface_color=n.color("subsurfaceColor", 0.83, 0.791, 0.753),
        subsurface_radius=n.number("subsurfaceDmfp", 10.0),
        subsurface_radius_scale=n.color("subsurfaceDmfpColor", 0.851, 0.557, 0.395),
        fuzz_weight=n.number("fuzzGain", 0.0),
        fuzz_color=n.color("fuzzColor", 1.0),
        coat_weight=ZERO if coat == BLACK else ONE,
        coat_roughness=n.number("clearcoatRoughness", 0.0),
        coat_ior=(ior_of(max(coat)),) if isinstance(coat, tuple) else (1.5,),
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        emission=r.scaled(n.color("glowColor", 1.0), n.number("glowGain", 0.0)),
        opacity=n.number("presence", 1.0),
        thin_walled=n.constants("thinGlass", 0.0) if glassy else ZERO,
        normal=n.normal("bumpNormal"),
        near=("subsurfaceDmfp",) if scattered != ZERO else (),
    )


def _note_lobes(n: ForeignInputs) -> None:
    """Record inputs of active lobes that are approximated or unsupported; inputs of lobes that are off have no effect."""
    names = ("roughSpecular", "iridescence", "singlescatter", "irradiance", "reflection", "diffuseTransmit", "continuousSingle")
    gains = {
        "roughSpecular": ("roughSpecularFaceColor", "roughSpecularEdgeColor"),
        "iridescence": ("iridescenceFaceGain", "iridescenceEdgeGain"),
        "singlescatter": ("singlescatterGain", "singlescatterDirectGain"),
        "irradiance": (),
        "reflection": (),
        "diffuseTransmit": ("diffuseTransmitGain",),
        "continuousSingle": (),
    }
    have = [str(name)[7:] for name in n.node.prim.GetPropertyNames() if str(name).startswith("inputs:")]
    for lobe in names:
        own = {name for name in have if name.startswith(lobe)}
        on = any(n.source(gain) is not None and n.color(gain, 0.0) != BLACK for gain in gains[lobe])
        n.asked |= own
        n.lost |= {name for name in gains[lobe] if name in own} if on else set()
    if n.number("fuzzGain", 0.0) != ZERO:
        n.near.add("fuzzGain")
    else:
        n.asked |= {name for name in have if name.startswith("fuzz")}
    if n.number("subsurfaceGain", 0.0) == ZERO:
        n.asked |= {name for name in have if name.startswith("subsurface")}
    if n.number("refractionGain", 0.0) == ZERO:
        n.asked |= {name for name in have if name.startswith(("glass", "refraction", "thinGlass"))}


def _reflected(n: ForeignInputs, lobe: str) -> Operand:
    """Return a lobe's reflectance at normal incidence: its face colour, or Fresnel's equations tinted by the edge colour."""
    edge = n.color(f"{lobe}EdgeColor", 0.0)
    n.asked |= {f"{lobe}{name}" for name in ("FresnelShape", "DoubleSided", "ModelType", "AnisotropyDirection", "BumpNormal")}
    if n.constants(f"{lobe}FresnelMode", 0.0) == ZERO:
        face = n.color(f"{lobe}FaceColor", 0.0)
        n.asked |= {f"{lobe}Ior", f"{lobe}ExtinctionCoeff"}
        if edge not in (WHITE, face):
            n.near.add(f"{lobe}EdgeColor")
        if face == BLACK and edge != BLACK:  # low at normal incidence: the least that MaterialX's own materials have
            return n.reader.scaled(edge, (0.02,))
        return face
    n.asked.add(f"{lobe}FaceColor")
    iors = n.constants(f"{lobe}Ior", 1.5, 1.5, 1.5)
    absorbed = n.constants(f"{lobe}ExtinctionCoeff", 0.0, 0.0, 0.0)
    pairs = [(min(max(i, 0.0), 1e6), min(abs(k), 1e6)) for i, k in zip(iors, absorbed, strict=True)]
    conductor = tuple(((i - 1) ** 2 + k * k) / ((i + 1) ** 2 + k * k) for i, k in pairs)
    return maths.binary(n.e, "multiply", edge, conductor)


def _metalness(n: ForeignInputs, face: Operand, dark: bool) -> Operand:
    """Return the metalness: 1 without a diffuse part, else by the reflectance at normal incidence."""
    if isinstance(face, tuple):
        most = max(face)
        if most <= _MOST_DIELECTRIC:
            return ZERO
        n.near.add("specularFaceColor")
        return ONE if dark else (min((most - _MOST_DIELECTRIC) / (_METALLIC - _MOST_DIELECTRIC), 1.0),)
    n.near.add("specularFaceColor")
    return ONE if dark else maths.between(n.e, maths.weighted(n.e, face, (1 / 3, 1 / 3, 1 / 3)), _MOST_DIELECTRIC, _METALLIC)


def _dielectric(n: ForeignInputs, face: Operand) -> tuple[Operand, Operand, Operand]:
    """Return the weight, tint and index of refraction for a reflectance at normal incidence."""
    if not isinstance(face, tuple):
        return ONE, WHITE, (1.5,)
    most = max(face)
    if most <= 0.0:
        return ZERO, WHITE, (1.5,)
    return ONE, tuple(x / most for x in face), (ior_of(min(most, _MOST_DIELECTRIC)),)


def _disney(n: ForeignInputs) -> KnownSurface:
    """Return PxrDisney, whose reflectivity is `specular` and whose emission is `emitColor`."""
    return _principled(n, n.number("specular", 0.5), ZERO, "emitColor")


def _disney_bsdf(n: ForeignInputs) -> KnownSurface:
    """Return PxrDisneyBsdf, whose reflectivity is an index of refraction, scaled by `specReflectScale`."""
    ior = n.constants("ior", 1.5)[0]
    specular = n.reader.times((head_on(ior) / _MOST_DIELECTRIC,), n.number("specReflectScale", 1.0))
    return _principled(n, specular, n.number("refraction", 0.0), "emissionColor")


def _principled(n: ForeignInputs, specular: Operand, transmitted: Operand, emission: str) -> KnownSurface:
    color = n.color("baseColor", 0.5)
    inputs: dict[str, Operand] = {
        "baseColor": color,
        "metallic": n.number("metallic", 0.0),
        "specular": specular,
        "specularTint": n.number("specularTint", 0.0),
        "roughness": n.number("roughness", 0.25),
        "anisotropic": n.number("anisotropic", 0.0),
        "sheen": n.number("sheen", 0.0),
        "sheenTint": n.number("sheenTint", 0.5),
        "clearcoat": n.number("clearcoat", 0.0),
        "clearcoatGloss": n.number("clearcoatGloss", 1.0),
        "specTrans": transmitted,
        "ior": n.constants("ior", 1.5),
        "subsurface": n.number("subsurface", 0.0),
        "subsurfaceDistance": WHITE,
    }
    known = disney_principled.read(Reader(inputs, n.e))
    scattered = n.color("subsurfaceColor", 0.0)
    return replace(
        known,
        subsurface_color=color if scattered == BLACK else scattered,
        emission=n.color(emission, 0.0),
        opacity=n.number("presence", 1.0),
        normal=n.normal("bumpNormal"),
    )


def _constant(n: ForeignInputs) -> KnownSurface:
    return KnownSurface(unlit=True, emission=n.color("emitColor", 1.0), opacity=n.number("presence", 1.0))


def _diffuse(n: ForeignInputs) -> KnownSurface:
    return KnownSurface(
        base_color=n.color("diffuseColor", 0.5),
        specular_weight=ZERO,
        opacity=n.number("presence", 1.0),
        normal=n.normal("bumpNormal"),
    )


AT_REST: dict[str, object] = {
    "diffuseDoubleSided": ANY,
    "diffuseBackUseDiffuseColor": ANY,
    "diffuseBackColor": ANY,
    "diffuseExponent": ONE,
    "diffuseBumpNormal": BLACK,
    "diffuseTransmitColor": ANY,
    "clearcoatThickness": ZERO,
    "clearcoatAbsorptionTint": BLACK,
    "utilityPattern": ANY,
    "userColor": ANY,
    "shadowColor": ANY,
    "shadowBumpTerminator": ANY,
    "emissionColor": BLACK,
    "diffTrans": ZERO,
    "flatness": ZERO,
    "thin": ZERO,
    "disable": ZERO,
    "inputMaterial": ANY,
    "surfaceNormalMix": ZERO,
    "reverse": ZERO,
    "bumpOverlay": BLACK,
}

VOCABULARY = Vocabulary(
    "RenderMan",
    kind_of,
    {
        "PxrSurface": _surface,
        "PxrDisney": _disney,
        "PxrDisneyBsdf": _disney_bsdf,
        "PxrConstant": _constant,
        "PxrDiffuse": _diffuse,
    },
    NODES,
    AT_REST,
)
