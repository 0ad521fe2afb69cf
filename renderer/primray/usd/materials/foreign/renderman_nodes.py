"""RenderMan's patterns: textures, manifolds, primvars, normals, and colour nodes (RenderMan documentation, "Patterns").

Rules return outputs by name, since several of these nodes have more than one: resultRGB, resultR, resultA, resultF, resultN.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ....description import NodeOutput, Operand
from ...materialx.expressions import Outputs
from . import maths
from .images import Lookup, coordinates, image
from .maths import ONE, ZERO
from .values import ForeignInputs

Rule = Callable[[ForeignInputs], Operand | Outputs | None]


def _rgb(n: ForeignInputs, color: Operand, alpha: Operand = ONE) -> Outputs:
    """Return the outputs of a colour node."""
    channels = {f"result{c}": maths.channel(n.e, color, i) for i, c in enumerate("RGB")}
    return {"": color, "resultRGB": color, "resultA": alpha, **channels}


def _as_number(n: ForeignInputs, value: Operand) -> Outputs:
    return {"": value, "resultF": value}


def _texture(n: ForeignInputs) -> Outputs:
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


def _texels(n: ForeignInputs, space: str) -> Operand:
    missing = (*n.constants("missingColor", 1.0, 0.0, 1.0), n.constants("missingAlpha", 1.0)[0])
    n.asked |= {"atlasStyle", "filter", "blur", "lerp", "mipBias", "maxResolution", "optimizeIndirect", "invertT"}
    if n.constants("firstChannel", 0.0) != ZERO:
        n.lost.add("firstChannel")
    at = Lookup(_manifold_of(n))
    return image(n, "filename", space, at, missing)


def _manifold_of(n: ForeignInputs) -> Operand:
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


def _placed(n: ForeignInputs, st: Operand, scale: tuple[float, float], offset: tuple[float, float]) -> Operand:
    scaled = n.e.apply("ND_multiply_vector2", in1=st, in2=scale)
    return n.e.apply("ND_add_vector2", in1=scaled, in2=offset)


def _manifold(n: ForeignInputs) -> Outputs:
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


def _primvar(n: ForeignInputs) -> Outputs:
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


def _normal_map(n: ForeignInputs) -> Outputs:
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


def _bump(n: ForeignInputs) -> Outputs:
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


def _mix(n: ForeignInputs) -> Outputs:
    n.asked.add("clampMix")
    return _rgb(n, maths.mixed(n.e, n.color("color1", 1.0), n.color("color2", 0.0), n.number("mix", 0.0)))


def _blend(n: ForeignInputs) -> Outputs:
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


def _inverted(n: ForeignInputs) -> Outputs:
    n.asked.add("colorModel")
    return _rgb(n, maths.inverted(n.e, n.color("inputRGB", 1.0)))


def _gamma(n: ForeignInputs) -> Outputs:
    return _rgb(n, maths.with_gamma(n.e, n.color("inputRGB", 0.0), n.number("gamma", 1.0)))


def _exposure(n: ForeignInputs) -> Outputs:
    return _rgb(n, maths.exposed(n.e, n.color("inputRGB", 0.0), n.number("stops", 0.0)))


def _hsl(n: ForeignInputs) -> Outputs:
    """Adjust hue in degrees, saturation, and lightness about the colour's luminance."""
    e, color = n.e, n.color("inputRGB", 0.0)
    turn = n.e.apply("ND_divide_float", in1=n.number("hue", 0.0), in2=(360.0,))
    color = maths.with_saturation(e, maths.with_hue(e, color, turn), n.number("saturation", 1.0))
    return _rgb(n, maths.scaled(e, color, n.number("lightness", 1.0)))


def _color_correct(n: ForeignInputs) -> Outputs:
    """Apply saturation, hue, exposure, gamma, multiply and add, in this order."""
    e, color = n.e, n.color("inputRGB", 0.0)
    made = maths.with_saturation(e, color, n.number("saturation", 1.0))
    made = maths.with_hue(e, made, n.e.apply("ND_divide_float", in1=n.number("hue", 0.0), in2=(360.0,)))
    made = maths.exposed(e, made, n.number("exposure", 0.0))
    made = maths.with_gamma(e, made, n.number("gamma", 1.0))
    made = maths.binary(e, "multiply", made, n.color("multiply", 1.0))
    made = maths.binary(e, "add", made, n.color("add", 0.0))
    return _rgb(n, maths.mixed(e, color, made, n.number("mask", 1.0)))


def _clamped(n: ForeignInputs) -> Outputs:
    low, high = n.color("min", 0.0), n.color("max", 1.0)
    return _rgb(n, n.e.apply("ND_clamp_color3", **{"in": n.color("inputRGB", 0.0), "low": low, "high": high}))


def _remapped(n: ForeignInputs) -> Outputs:
    e, low, high = n.e, n.number("inputMin", 0.0), n.number("inputMax", 1.0)
    out_low, out_high = n.number("outputMin", 0.0), n.number("outputMax", 1.0)
    off = e.apply("ND_subtract_color3FA", in1=n.color("inputRGB", 0.0), in2=low)
    made = e.apply("ND_divide_color3FA", in1=off, in2=e.apply("ND_subtract_float", in1=high, in2=low))
    made = maths.scaled(e, made, e.apply("ND_subtract_float", in1=out_high, in2=out_low))
    return _rgb(n, e.apply("ND_add_color3FA", in1=made, in2=out_low))


def _to_float(n: ForeignInputs) -> Outputs:
    """Return a colour's channel, average, or luminance."""
    mode = int(n.constants("mode", 0.0)[0])
    color = n.color("input", 0.0)
    if mode in (0, 1, 2):
        return _as_number(n, maths.channel(n.e, color, mode))
    return _as_number(n, maths.weighted(n.e, color, (1 / 3, 1 / 3, 1 / 3) if mode == 3 else maths.LUMA))


def _to_float3(n: ForeignInputs) -> Outputs:
    value = n.number("input")
    parts = [n.number(f"input{c}") if n.source(f"input{c}") is not None else value for c in "RGB"]
    return _rgb(n, n.e.apply("ND_combine3_color3", in1=parts[0], in2=parts[1], in3=parts[2]))


def _checker(n: ForeignInputs) -> Outputs:
    e, st = n.e, _manifold_of(n)
    cell = e.apply("ND_floor_vector2", **{"in": e.apply("ND_multiply_vector2", in1=st, in2=(2.0, 2.0))})
    total = e.apply("ND_dotproduct_vector2", in1=cell, in2=(1.0, 1.0))
    odd = e.apply("ND_modulo_float", in1=total, in2=(2.0,))
    return _rgb(n, maths.mixed(e, n.color("colorA", 1.0), n.color("colorB", 0.0), odd))


def _facing_ratio(n: ForeignInputs) -> Outputs:
    n.asked |= {"faceForward"}
    return _as_number(n, n.e.apply("ND_facingratio_float", invert=(float(n.is_on("invert")),)))


def _dot(n: ForeignInputs) -> Outputs:
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
