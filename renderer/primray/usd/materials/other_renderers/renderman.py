"""RenderMan's surfaces and patterns, each surface read into a KnownSurface (RenderMan documentation).

PxrSurface adds up lobes, each with its own gain and reflectivity; here they become the lobes of one layered surface, so that
most of its inputs are approximated, and reported as such. Rules of patterns return outputs by name, since several of these
nodes have more than one: resultRGB, resultR, resultA, resultF, resultN.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from ....description import NodeOutput, Operand
from ..materialx.expressions import Outputs
from ..models import disney_principled
from ..models.conversions import ior_for_reflectance, normal_reflectance
from ..models.open_pbr import BLACK, ONE, WHITE, ZERO, KnownSurface, Reader
from ..network import Node
from . import maths
from .images import Lookup, coordinates, image
from .values import ANY, RendererInputs, Vocabulary

Rule = Callable[[RendererInputs], Operand | Outputs | None]


def _rgb(n: RendererInputs, color: Operand, alpha: Operand = ONE) -> Outputs:
    """Return the outputs of a colour node."""
    channels = {f"result{c}": maths.channel(n.e, color, i) for i, c in enumerate("RGB")}
    return {"": color, "resultRGB": color, "resultA": alpha, **channels}


def _as_number(n: RendererInputs, value: Operand) -> Outputs:
    return {"": value, "resultF": value}


def _texture(n: RendererInputs) -> Outputs:
    """Return texels, decoded from sRGB with `linearize`; invertT, on by default, matches USD's texture coordinates."""
    texels = _texels(n, "sRGB" if n.is_on("linearize") else "raw")
    e = n.e
    color = e.apply("ND_convert_color4_color3", **{"in": texels})
    color = maths.binary(e, "multiply", color, n.color("colorScale", 1.0))
    color = maths.binary(e, "add", color, n.color("colorOffset", 0.0))
    color = maths.with_saturation(e, color, n.number("saturation", 1.0))
    alpha = e.apply("ND_extract_color4", **{"in": texels, "index": (3.0,)})
    alpha = e.apply("ND_multiply_float", in1=alpha, in2=n.number("alphaScale", 1.0))
    alpha = e.apply("ND_add_float", in1=alpha, in2=n.number("alphaOffset", 0.0))
    return _rgb(n, color, alpha)


def _texels(n: RendererInputs, space: str) -> Operand:
    missing = (*n.constants("missingColor", 1.0, 0.0, 1.0), n.constants("missingAlpha", 1.0)[0])
    n.asked |= {"atlasStyle", "filter", "blur", "lerp", "mipBias", "maxResolution", "optimizeIndirect", "invertT"}
    if n.constants("firstChannel", 0.0) != ZERO:
        n.lost.add("firstChannel")
    at = Lookup(_manifold_of(n))
    return image(n, "filename", space, at, missing)


def _manifold_of(n: RendererInputs) -> Operand:
    """Return a connected manifold's coordinates.

    They are flipped in t unless exactly one of manifold and texture has invertT.
    """
    source = n.shader("manifold")
    st: Operand | None = None
    inverted = n.is_on("invertT", True)
    if source is not None:
        st = n.values.output(source, 2, n.node, "manifold")
        if n.values.vocabulary.kind_of(source) == "PxrManifold2D":
            inverted = True  # the manifold's own default
    st = "UV0" if st is None else st
    return st if inverted else _placed(n, st, (1.0, -1.0), (0.0, 1.0))


def _placed(n: RendererInputs, st: Operand, scale: tuple[float, float], offset: tuple[float, float]) -> Operand:
    scaled = n.e.apply("ND_multiply_vector2", in1=st, in2=scale)
    return n.e.apply("ND_add_vector2", in1=scaled, in2=offset)


def _manifold(n: RendererInputs) -> Outputs:
    """Return coordinates rotated in degrees, scaled and offset; primvarT is taken to equal primvarS, as it mostly does."""
    name, other = n.text("primvarS"), n.text("primvarT")
    if other and other != name:
        n.lost.add("primvarT")
    st = coordinates(n, name)
    e = n.e
    angle = n.constants("angle", 0.0)
    if angle != ZERO:
        st = e.apply("ND_rotate2d_vector2", **{"in": st, "amount": (-angle[0],)})
    scale = (n.constants("scaleS", 1.0)[0], n.constants("scaleT", 1.0)[0])
    offset = (n.constants("offsetS", 0.0)[0], n.constants("offsetT", 0.0)[0])
    if n.is_on("invertS"):
        scale, offset = (-scale[0], scale[1]), (1.0 - offset[0], offset[1])
    n.asked.add("invertT")  # combined with the texture's in _manifold_of
    st = _placed(n, st, scale, offset)
    whole = e.apply("ND_texcoord_vector2", index=ZERO) if st == "UV0" else st
    parts = {f"result{c}": e.apply("ND_extract_vector2", **{"in": whole, "index": (i,)}) for i, c in ((0.0, "S"), (1.0, "T"))}
    return {"": st, "result": st, **parts}


def _primvar(n: RendererInputs) -> Outputs:
    """Return a primvar of the shape by its name, as numbers or as a colour by its type."""
    name, kind = n.text("varname"), n.text("type", "float")
    default = n.constants("defaultFloat3", 0.0, 0.0, 0.0) if kind != "float" else n.constants("defaultFloat", 0.0)
    n.asked |= {"defaultFloat", "defaultFloat3", "defaultInt", "varnameType", "coordsys"}
    if kind in ("float", "int"):
        made = n.e.apply("ND_geompropvalue_float", geomprop=name, default=default[:1]) if name else default[:1]
        return {"": made, "resultF": made, "resultRGB": maths.grey(n.e, made)}
    form = "color3" if kind == "color" else "vector3"
    made = n.e.apply(f"ND_geompropvalue_{form}", geomprop=name, default=default) if name else default
    outputs = _rgb(n, made)
    return {**outputs, "resultP": made, "resultF": outputs["resultR"]}


def _normal_map(n: RendererInputs) -> Outputs:
    """Return a normal map's normal in the tangent frame; `orientation` 1 is Direct3D's, whose green channel points down."""
    e = n.e
    given = n.color("inputRGB", 0.5, 0.5, 1.0)
    if not isinstance(given, NodeOutput):
        given = e.apply("ND_convert_color4_color3", **{"in": _texels(n, "raw")}) if n.source("filename") is not None else given
    n.asked.add("linearize")
    coded = e.apply("ND_convert_color3_vector3", **{"in": given})
    flips_x = n.is_on("flipX")
    flips_y = n.is_on("flipY") != (n.constants("orientation", 0.0) == ONE)
    strength = n.constants("bumpScale", 1.0)[0] * (-1.0 if n.is_on("invertBump") else 1.0)
    if n.is_on("disable"):
        return {"": (0.0, 0.0, 0.0)}
    n.asked |= {"surfaceNormalMix", "reverse", "bumpOverlay"} if not n.is_on("bumpOverlay") else set()
    scale = (-strength if flips_x else strength, -strength if flips_y else strength)
    if scale[0] == scale[1]:
        made = e.apply("ND_normalmap_float", **{"in": coded, "scale": scale[:1]})
    else:
        made = e.apply("ND_normalmap_vector2", **{"in": coded, "scale": scale})
    return {"": made, "resultN": made}


def _bump(n: RendererInputs) -> Outputs:
    """Return a normal from the slopes of a height along the texture coordinates, one unit of which counts as a scene unit."""
    height = n.number("inputBump")
    if isinstance(height, tuple) and n.source("filename") is not None:
        height = n.e.apply("ND_extract_color4", **{"in": _texels(n, "raw"), "index": ZERO})
    if isinstance(height, tuple) or n.is_on("disable"):
        return {"": (0.0, 0.0, 0.0)}
    n.near.add("scale")
    coded = n.e.apply("ND_heighttonormal_vector3", **{"in": height, "scale": n.number("scale", 1.0)})
    made = n.e.apply("ND_normalmap_float", **{"in": coded})
    return {"": made, "resultN": made}


def _mix(n: RendererInputs) -> Outputs:
    n.asked.add("clampMix")
    return _rgb(n, maths.mixed(n.e, n.color("color1", 1.0), n.color("color2", 0.0), n.number("mix", 0.0)))


def _blend(n: RendererInputs) -> Outputs:
    """Composite one colour over another; operations that MaterialX does not have are ignored."""
    e, top, bottom = n.e, n.color("topRGB", 0.0), n.color("bottomRGB", 0.0)
    alpha = n.number("topA", 1.0)
    n.asked |= {"bottomA", "clampOutput"}
    known: Mapping[int, Callable[[], Operand]] = {
        4: lambda: e.apply("ND_difference_color3", fg=top, bg=bottom),
        10: lambda: e.apply("ND_screen_color3", fg=top, bg=bottom),
        18: lambda: maths.binary(e, "multiply", top, bottom),
        19: lambda: top,
        2: lambda: maths.binary(e, "add", top, bottom),
    }
    operation = int(n.constants("operation", 19.0)[0])
    if operation not in known:
        n.lost.add("operation")
    made = known.get(operation, known[19])()
    return _rgb(n, maths.mixed(e, bottom, made, alpha))


def _inverted(n: RendererInputs) -> Outputs:
    n.asked.add("colorModel")
    return _rgb(n, maths.inverted(n.e, n.color("inputRGB", 1.0)))


def _gamma(n: RendererInputs) -> Outputs:
    return _rgb(n, maths.with_gamma(n.e, n.color("inputRGB", 0.0), n.number("gamma", 1.0)))


def _exposure(n: RendererInputs) -> Outputs:
    return _rgb(n, maths.exposed(n.e, n.color("inputRGB", 0.0), n.number("stops", 0.0)))


def _hsl(n: RendererInputs) -> Outputs:
    """Adjust hue in degrees, saturation, and lightness about the colour's luminance."""
    e, color = n.e, n.color("inputRGB", 0.0)
    turn = n.e.apply("ND_divide_float", in1=n.number("hue", 0.0), in2=(360.0,))
    color = maths.with_saturation(e, maths.with_hue(e, color, turn), n.number("saturation", 1.0))
    return _rgb(n, maths.scaled(e, color, n.number("lightness", 1.0)))


def _color_correct(n: RendererInputs) -> Outputs:
    """Apply saturation, hue, exposure, gamma, multiply and add, in this order."""
    e, color = n.e, n.color("inputRGB", 0.0)
    made = maths.with_saturation(e, color, n.number("saturation", 1.0))
    made = maths.with_hue(e, made, n.e.apply("ND_divide_float", in1=n.number("hue", 0.0), in2=(360.0,)))
    made = maths.exposed(e, made, n.number("exposure", 0.0))
    made = maths.with_gamma(e, made, n.number("gamma", 1.0))
    made = maths.binary(e, "multiply", made, n.color("multiply", 1.0))
    made = maths.binary(e, "add", made, n.color("add", 0.0))
    return _rgb(n, maths.mixed(e, color, made, n.number("mask", 1.0)))


def _clamped(n: RendererInputs) -> Outputs:
    low, high = n.color("min", 0.0), n.color("max", 1.0)
    return _rgb(n, n.e.apply("ND_clamp_color3", **{"in": n.color("inputRGB", 0.0), "low": low, "high": high}))


def _remapped(n: RendererInputs) -> Outputs:
    e, low, high = n.e, n.number("inputMin", 0.0), n.number("inputMax", 1.0)
    out_low, out_high = n.number("outputMin", 0.0), n.number("outputMax", 1.0)
    off = e.apply("ND_subtract_color3FA", in1=n.color("inputRGB", 0.0), in2=low)
    made = e.apply("ND_divide_color3FA", in1=off, in2=e.apply("ND_subtract_float", in1=high, in2=low))
    made = maths.scaled(e, made, e.apply("ND_subtract_float", in1=out_high, in2=out_low))
    return _rgb(n, e.apply("ND_add_color3FA", in1=made, in2=out_low))


def _to_float(n: RendererInputs) -> Outputs:
    """Return a colour's channel, average, or luminance."""
    mode = int(n.constants("mode", 0.0)[0])
    color = n.color("input", 0.0)
    if mode in (0, 1, 2):
        return _as_number(n, maths.channel(n.e, color, mode))
    return _as_number(n, maths.weighted(n.e, color, (1 / 3, 1 / 3, 1 / 3) if mode == 3 else maths.LUMA))


def _to_float3(n: RendererInputs) -> Outputs:
    value = n.number("input")
    parts = [n.number(f"input{c}") if n.source(f"input{c}") is not None else value for c in "RGB"]
    return _rgb(n, n.e.apply("ND_combine3_color3", in1=parts[0], in2=parts[1], in3=parts[2]))


def _checker(n: RendererInputs) -> Outputs:
    e, st = n.e, _manifold_of(n)
    cell = e.apply("ND_floor_vector2", **{"in": e.apply("ND_multiply_vector2", in1=st, in2=(2.0, 2.0))})
    total = e.apply("ND_dotproduct_vector2", in1=cell, in2=(1.0, 1.0))
    odd = e.apply("ND_modulo_float", in1=total, in2=(2.0,))
    return _rgb(n, maths.mixed(e, n.color("colorA", 1.0), n.color("colorB", 0.0), odd))


def _facing_ratio(n: RendererInputs) -> Outputs:
    n.asked |= {"faceForward"}
    return _as_number(n, n.e.apply("ND_facingratio_float", invert=(float(n.is_on("invert")),)))


def _dot(n: RendererInputs) -> Outputs:
    return _as_number(n, n.e.apply("ND_dotproduct_vector3", in1=n.vector("vector1", 0.0), in2=n.vector("vector2", 0.0)))


NODES: dict[str, Rule] = {
    "PxrTexture": _texture,
    "PxrManifold2D": _manifold,
    "PxrPrimvar": _primvar,
    "PxrNormalMap": _normal_map,
    "PxrBump": _bump,
    "PxrMix": _mix,
    "PxrBlend": _blend,
    "PxrInvert": _inverted,
    "PxrGamma": _gamma,
    "PxrExposure": _exposure,
    "PxrHSL": _hsl,
    "PxrColorCorrect": _color_correct,
    "PxrClamp": _clamped,
    "PxrRemap": _remapped,
    "PxrToFloat": _to_float,
    "PxrToFloat3": _to_float3,
    "PxrChecker": _checker,
    "PxrFacingRatio": _facing_ratio,
    "PxrDot": _dot,
}


_MOST_DIELECTRIC = 0.08  # greatest reflectance at normal incidence of a dielectric
_METALLIC = 0.5  # least reflectance at normal incidence of a metal


def kind_of(node: Node) -> str:
    """Return a shader's name without the version of Houdini's own nodes ("PxrSurface::3.0"), "" where it is not RenderMan's."""
    name = node.id.partition("::")[0]
    return name if name.startswith("Pxr") and name[3:4].isupper() else ""


def _surface(n: RendererInputs) -> KnownSurface:
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
        coat_ior=(ior_for_reflectance(max(coat)),) if isinstance(coat, tuple) else (1.5,),
        coat_darkening=ZERO,
        coat_roughening=ZERO,
        emission=r.scaled(n.color("glowColor", 1.0), n.number("glowGain", 0.0)),
        opacity=n.number("presence", 1.0),
        thin_walled=n.constants("thinGlass", 0.0) if glassy else ZERO,
        normal=n.normal("bumpNormal"),
        near=("subsurfaceDmfp",) if scattered != ZERO else (),
    )


def _note_lobes(n: RendererInputs) -> None:
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
    have = n.node.shader.inputs
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


def _reflected(n: RendererInputs, lobe: str) -> Operand:
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


def _metalness(n: RendererInputs, face: Operand, dark: bool) -> Operand:
    """Return the metalness: 1 without a diffuse part, else by the reflectance at normal incidence."""
    if isinstance(face, tuple):
        most = max(face)
        if most <= _MOST_DIELECTRIC:
            return ZERO
        n.near.add("specularFaceColor")
        return ONE if dark else (min((most - _MOST_DIELECTRIC) / (_METALLIC - _MOST_DIELECTRIC), 1.0),)
    n.near.add("specularFaceColor")
    return ONE if dark else maths.between(n.e, maths.weighted(n.e, face, (1 / 3, 1 / 3, 1 / 3)), _MOST_DIELECTRIC, _METALLIC)


def _dielectric(n: RendererInputs, face: Operand) -> tuple[Operand, Operand, Operand]:
    """Return the weight, tint and index of refraction for a reflectance at normal incidence."""
    if not isinstance(face, tuple):
        return ONE, WHITE, (1.5,)
    most = max(face)
    if most <= 0.0:
        return ZERO, WHITE, (1.5,)
    return ONE, tuple(x / most for x in face), (ior_for_reflectance(min(most, _MOST_DIELECTRIC)),)


def _disney(n: RendererInputs) -> KnownSurface:
    """Return PxrDisney, whose reflectivity is `specular` and whose emission is `emitColor`."""
    return _principled(n, n.number("specular", 0.5), ZERO, "emitColor")


def _disney_bsdf(n: RendererInputs) -> KnownSurface:
    """Return PxrDisneyBsdf, whose reflectivity is an index of refraction, scaled by `specReflectScale`."""
    ior = n.constants("ior", 1.5)[0]
    specular = n.reader.times((normal_reflectance(ior) / _MOST_DIELECTRIC,), n.number("specReflectScale", 1.0))
    return _principled(n, specular, n.number("refraction", 0.0), "emissionColor")


def _principled(n: RendererInputs, specular: Operand, transmitted: Operand, emission: str) -> KnownSurface:
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


def _constant(n: RendererInputs) -> KnownSurface:
    return KnownSurface(unlit=True, emission=n.color("emitColor", 1.0), opacity=n.number("presence", 1.0))


def _diffuse(n: RendererInputs) -> KnownSurface:
    return KnownSurface(
        base_color=n.color("diffuseColor", 0.5),
        specular_weight=ZERO,
        opacity=n.number("presence", 1.0),
        normal=n.normal("bumpNormal"),
    )


NEUTRAL: dict[str, object] = {
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
    NEUTRAL,
)
