"""Arnold's nodes that vary over a surface: images, ramps, checkers, noise, user data, normals (Arnold User Guide)."""

from __future__ import annotations

from collections.abc import Callable

from ....description import Operand
from ..materialx.expressions import Outputs
from . import maths
from .images import Lookup, image, moved, swapped, texture_set
from .maths import ONE, ZERO
from .values import RendererInputs

Rule = Callable[[RendererInputs], Operand | Outputs | None]
_WRAPS = ("periodic", "black", "clamp", "mirror", "file")
_FILTERS = ("closest", "bilinear", "bicubic", "smart_bicubic")
_RAMPS = ("custom", "u", "v", "diagonal", "radial", "box", "circular")


def _image(n: RendererInputs) -> Operand:
    """Return texels times `multiply` plus `offset`; with `single_channel`, their first channel as a grey."""
    e = n.e
    missing = n.constants("missing_texture_color", 0.0, 0.0, 0.0, 0.0)
    n.asked |= {"ignore_missing_textures", "mipmap_bias"}
    wraps = [n.choice(name, _WRAPS, "periodic") for name in ("swrap", "twrap")]
    n.lost |= {name for name, wrap in zip(("swrap", "twrap"), wraps, strict=True) if wrap == "file"}
    wrap_s, wrap_t = ("periodic" if wrap == "file" else wrap for wrap in wraps)
    at = Lookup(_image_coordinates(n), wrap_s, wrap_t, n.choice("filter", _FILTERS, "smart_bicubic") == "closest")
    texels = image(n, "filename", n.text("color_space", "auto"), at, missing)
    if n.wants_alpha:
        n.asked |= {"multiply", "offset", "single_channel"}
        return e.apply("ND_extract_color4", **{"in": texels, "index": (3.0,)})
    color = e.apply("ND_convert_color4_color3", **{"in": texels})
    if n.is_on("single_channel"):
        color = maths.grey(e, e.apply("ND_extract_color4", **{"in": texels, "index": (0.0,)}))
    color = maths.binary(e, "multiply", color, n.color("multiply", 1.0))
    return maths.binary(e, "add", color, n.color("offset", 0.0))


def _image_coordinates(n: RendererInputs) -> Operand:
    """Return the coordinates that `uvset` names, swapped, flipped, then scaled and offset."""
    st = n.operand("uvcoords", "vector2", (0.0, 0.0))
    if isinstance(st, tuple):
        st = texture_set(n, "uvset")
    if n.is_on("swap_st"):
        st = swapped(n, st)
    scale, offset = [1.0, 1.0], [0.0, 0.0]
    for i, axis in enumerate("st"):
        by, to = n.constants(f"{axis}scale", 1.0)[0], n.constants(f"{axis}offset", 0.0)[0]
        flips = n.is_on(f"{axis}flip")
        scale[i], offset[i] = (-by, to + by) if flips else (by, to)
    return moved(n, st, tuple(scale), tuple(offset))


def _ramp_rgb(n: RendererInputs) -> Operand:
    return _ramp(n, [(c, 3) for c in n.listed("color", 3)])


def _ramp_float(n: RendererInputs) -> Operand:
    made = _ramp(n, [(v * 3, 3) for v in n.listed("value", 1)])
    return maths.channel(n.e, made, 0)


def _ramp(n: RendererInputs, values: list[tuple[tuple[float, ...], int]]) -> Operand:
    """Return a ramp whose segments are constant, linear, or smooth, which is approximated by a smoothstep."""
    places = [p[0] for p in n.listed("position", 1)]
    kinds = [int(k[0]) for k in n.listed("interpolation", 1)] or [1]
    x = _along_ramp(n)
    count = min(len(values), len(places))
    if not count:
        n.lost |= {"position"}
        return maths.BLACK
    kinds += [kinds[-1]] * (count - len(kinds))
    smooth = any(kind > 1 for kind in kinds[:count])
    n.near |= {"interpolation"} if smooth else set()
    knots: list[tuple[float, Operand, bool]] = [(places[i], values[i][0], kinds[i] == 0) for i in range(count)]
    return maths.ramp(n.e, x, knots, smooth=smooth)


def _along_ramp(n: RendererInputs) -> Operand:
    kind = n.choice("type", _RAMPS, "custom")
    if kind == "custom":
        n.asked |= {"uvset", "wrap_uvs"}
        return n.number("input")
    n.asked.add("input")
    e, st = n.e, texture_set(n, "uvset")
    if st == "UV0":
        st = e.apply("ND_texcoord_vector2", index=(0.0,))
    u, v = (e.apply("ND_extract_vector2", **{"in": st, "index": (i,)}) for i in (0.0, 1.0))
    if n.is_on("wrap_uvs"):
        u, v = (e.apply("ND_fract_float", **{"in": x}) for x in (u, v))
    if kind == "v":
        return v
    if kind == "diagonal":
        return e.apply("ND_multiply_float", in1=e.apply("ND_add_float", in1=u, in2=v), in2=(0.5,))
    if kind == "circular":
        off = e.apply("ND_subtract_vector2", in1=e.apply("ND_combine2_vector2", in1=u, in2=v), in2=(0.5, 0.5))
        far = e.apply("ND_magnitude_vector2", **{"in": off})
        return e.apply("ND_multiply_float", in1=far, in2=(2.0,))
    if kind != "u":
        n.lost.add("type")
    return u


def _checkerboard(n: RendererInputs) -> Operand:
    """Return two checks per unit of the coordinates at frequency 1, with color2 at the origin."""
    frequency = tuple(2.0 * n.constants(f"{axis}_frequency", 1.0)[0] for axis in "uv")
    offset = tuple(2.0 * n.constants(f"{axis}_offset", 0.0)[0] for axis in "uv")
    st = moved(n, texture_set(n, "uvset"), frequency, offset)
    cell = n.e.apply("ND_floor_vector2", **{"in": st})
    total = n.e.apply("ND_dotproduct_vector2", in1=cell, in2=(1.0, 1.0))
    odd = n.e.apply("ND_modulo_float", in1=total, in2=(2.0,))
    if n.constants("contrast", 1.0) != ONE:
        n.lost.add("contrast")
    return maths.mixed(n.e, n.color("color2", 0.0), n.color("color1", 1.0), odd)


def _noise(n: RendererInputs) -> Operand:
    """Return Perlin noise between color1 and color2; its hash differs from Arnold's."""
    e = n.e
    n.near |= {"noise"}
    space = n.choice("coord_space", ("world", "object", "Pref", "uv"), "object")
    if space == "uv":
        st = e.apply("ND_texcoord_vector2", index=ZERO)
        parts = [e.apply("ND_extract_vector2", **{"in": st, "index": (i,)}) for i in (0.0, 1.0)]
        place = e.apply("ND_combine3_vector3", in1=parts[0], in2=parts[1], in3=ZERO)
    else:
        n.lost |= {"coord_space"} if space == "Pref" else set()
        place = e.apply("ND_position_vector3", space="world" if space == "world" else "object")
    place = e.apply("ND_multiply_vector3", in1=place, in2=n.vector("scale", 1.0))
    place = e.apply("ND_add_vector3", in1=place, in2=n.vector("offset", 0.0))
    value = e.apply(
        "ND_fractal3d_float",
        amplitude=n.number("amplitude", 1.0),
        octaves=n.constants("octaves", 1.0),
        lacunarity=n.constants("lacunarity", 1.92),
        position=place,
    )
    value = e.apply("ND_add_float", in1=e.apply("ND_multiply_float", in1=value, in2=(0.5,)), in2=(0.5,))
    value = e.apply("ND_clamp_float", **{"in": value, "low": ZERO, "high": ONE})
    return maths.mixed(e, n.color("color1", 0.0), n.color("color2", 1.0), value)


def _user_data(kind: str, width: int) -> Rule:
    def rule(n: RendererInputs) -> Operand:
        default = n.constants("default", *(0.0,) * width)
        name = n.text("attribute")
        if not name:
            return default
        return n.e.apply(f"ND_geompropvalue_{kind}", geomprop=name, default=default)

    return rule


def _normal_map(n: RendererInputs) -> Operand:
    """Return a normal map's normal in the tangent frame; other frames and other orders of axes are ignored."""
    e = n.e
    given = e.apply("ND_convert_color3_vector3", **{"in": n.color("input", 0.5, 0.5, 1.0)})
    if not n.is_on("color_to_signed", True):
        half = e.apply("ND_multiply_vector3FA", in1=given, in2=(0.5,))
        given = e.apply("ND_add_vector3FA", in1=half, in2=(0.5,))
    if not n.is_on("tangent_space", True):
        n.lost.add("tangent_space")
    if n.choice("order", ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"), "XYZ") != "XYZ":
        n.lost.add("order")
    flips = [n.is_on(f"invert_{axis}") for axis in "xyz"]
    if any(flips):
        given = e.apply("ND_multiply_vector3", in1=given, in2=tuple(-1.0 if f else 1.0 for f in flips))
        given = e.apply("ND_add_vector3", in1=given, in2=tuple(float(f) for f in flips))
    return e.apply("ND_normalmap_float", **{"in": given, "scale": n.number("strength", 1.0)})


def _bump2d(n: RendererInputs) -> Operand:
    """Return a normal from the slopes of a height along the texture coordinates, one unit of which counts as a scene unit."""
    height = n.number("bump_map")
    by = n.number("bump_height", 1.0)
    if isinstance(height, tuple):
        return n.normal("normal")
    n.near.add("bump_height")
    coded = n.e.apply("ND_heighttonormal_vector3", **{"in": height, "scale": by})
    return n.e.apply("ND_normalmap_float", **{"in": coded})


def _facing_ratio(n: RendererInputs) -> Operand:
    if any(n.number(name, 0.5) != (0.5,) for name in ("bias", "gain")):
        n.lost |= {"bias", "gain"}
    return n.e.apply("ND_facingratio_float", invert=(float(n.is_on("invert")),))


def _state_float(n: RendererInputs) -> Operand | None:
    index = {"u": 0.0, "v": 1.0}.get(n.text("variable"))
    if index is None:
        n.lost.add("variable")
        return ZERO
    st = n.e.apply("ND_texcoord_vector2", index=ZERO)
    return n.e.apply("ND_extract_vector2", **{"in": st, "index": (index,)})


def _state_vector(n: RendererInputs) -> Operand | None:
    name = n.text("variable")
    known = {"P": ("position", "world"), "Po": ("position", "object"), "N": ("normal", "world"), "Nf": ("normal", "world")}
    if name not in known:
        n.lost.add("variable")
        return maths.BLACK
    category, space = known[name]
    return n.e.apply(f"ND_{category}_vector3", space=space)


PATTERNS: dict[str, Rule] = {
    "image": _image,
    "ramp_rgb": _ramp_rgb,
    "ramp_float": _ramp_float,
    "checkerboard": _checkerboard,
    "noise": _noise,
    "user_data_float": _user_data("float", 1),
    "user_data_int": _user_data("float", 1),
    "user_data_rgb": _user_data("color3", 3),
    "user_data_rgba": _user_data("color4", 4),
    "normal_map": _normal_map,
    "bump2d": _bump2d,
    "facing_ratio": _facing_ratio,
    "state_float": _state_float,
    "state_vector": _state_vector,
}
