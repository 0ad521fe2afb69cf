"""Nodes that read images: MaterialX's, UsdUVTexture and UsdTransform2d, hexagonal tiling, normal maps.

(0, 0) is an image's lower left corner; cubic filters are replaced by linear ones. Hexagonal tiling hides an image's repetition
by three tiles around each point, rotated, scaled and offset at random: Mikkelsen 2022, "Practical Real-Time Hex-Tiling"
(JCGT 11 (3)), with the hash and the constants of MaterialX's library. USD's nodes follow the UsdPreviewSurface specification.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ....description.shading import TRANSFORM_2D, UV_TEXTURE
from ..program import FOOTPRINT_SHIFTS, NO_SHIFT, SLOPE_SHIFTS, Node, Program, Value


def offsets(n: Node) -> list[Value]:
    """Return the differences of the coordinates over the pixel's footprint, in two directions."""
    return [n.read("texcoord", shift) - n.read("texcoord", NO_SHIFT) for shift in FOOTPRINT_SHIFTS]


def texel(n: Node, image: int, at: Value, off: Sequence[Value], width: int, default: Value) -> Value:
    """Return the image's value at coordinates, filtered over the footprint that the offsets span."""
    return n.program.apply("image", at, at + off[0], at + off[1], default, width=width, data=image)


def image(n: Node) -> Value:
    file, default = n.file("file"), n["default"]
    number = None if file is None else n.around.image(file, n.width, n)
    if number is None:
        return default
    at = n["texcoord"]
    found = texel(n, number, at, offsets(n), n.width, default)
    for component, mode in enumerate(("uaddressmode", "vaddressmode")):
        if n.text(mode) == "constant":
            p, x = n.program, at[component]
            found = p.select(p.not_above(0.0, x) * p.not_above(x, 1.0), found, default)
    return found


IMAGE_NODES = {"image": image}


def uv_texture(n: Node) -> Value:
    """Return channels of the texels, times scale plus bias. The fallback is neither scaled nor biased."""
    channels, file = n.text("channels"), n.file("file")
    scale, bias, fallback = (
        n.program.pack([n[name]["rgba".index(c)] for c in channels]) for name in ("scale", "bias", "fallback")
    )
    number = None if file is None else n.around.image(file, n.width, n)
    if number is None:
        return fallback
    at = n["st"]
    off = [n.read("st", shift) - n.read("st", NO_SHIFT) for shift in FOOTPRINT_SHIFTS]
    missing = (fallback - bias) / scale if all(scale.constant or (0.0,)) else fallback  # for missing tiles of a UDIM set
    return texel(n, number, at, off, n.width, missing) * scale + bias


def transform_2d(n: Node) -> Value:
    """Scale, rotate counter-clockwise by degrees, and translate."""
    p, scaled, angle = n.program, n["in"] * n["scale"], n["rotation"] * math.radians(1)
    sine, cosine = p.apply("sin", angle), p.apply("cos", angle)
    x, y = scaled.components
    return p.pack([x * cosine - y * sine, x * sine + y * cosine]) + n["translation"]


USD_NODES = {UV_TEXTURE: uv_texture, TRANSFORM_2D: transform_2d}


GRID = 2 * math.sqrt(3)  # cells of the triangle grid in a unit of coordinates
SKEW, STRETCH = -0.57735027, 1.15470054
SEED = 0.12345
PLAIN_FALLOFF = 0.5
LEAST_COSINE = 1e-8


@dataclass(frozen=True)
class HexTile:
    at: Value
    off: list[Value]
    weight: Value
    angle: Value


def _pair(p: Program, x: Value, y: Value) -> Value:
    return p.pack([x, y])


def _random(p: Program, cell: Value) -> Value:
    """Return two numbers in [0, 1) for a cell, a hash of its coordinates."""
    at = cell + SEED
    q = p.fract(p.pack([at[0] * 0.1031, at[1] * 0.1030, at[0] * 0.0973]))
    q = q + p.dot(q, p.pack([q[1], q[2], q[0]]) + 33.33)
    return p.fract(_pair(p, (q[0] + q[1]) * q[2], (q[0] + q[2]) * q[1]))


def _turned(p: Program, v: Value, sine: Value, cosine: Value) -> Value:
    return _pair(p, v[0] * cosine - v[1] * sine, v[0] * sine + v[1] * cosine)


def _ranged(p: Program, ends: Value, share: Value) -> Value:
    return p.mix(ends[0], ends[1], share)


def hex_tiles(n: Node) -> list[HexTile]:
    p = n.program
    at = n["texcoord"] * n["tiling"]
    off = [o * n["tiling"] for o in offsets(n)]
    x, y = (at * GRID).components
    skewed = _pair(p, x + y * SKEW, y * STRETCH)
    base = p.floor(skewed)
    fx, fy = (skewed - base).components
    fz = 1.0 - fx - fy
    upper = p.not_above(fz, 0.0)
    side, other = upper * 2.0 - 1.0, 1.0 - upper
    cells = [(upper, upper, -fz * side), (upper, other, upper - fy * side), (other, upper, upper - fx * side)]
    return [_tile(n, at, off, base + _pair(p, i, j), weight) for i, j, weight in cells]


def _tile(n: Node, at: Value, off: Sequence[Value], cell: Value, weight: Value) -> HexTile:
    p, random = n.program, _random(n.program, cell)
    i, j = (cell / GRID).components
    center = _pair(p, i + j * 0.5, j * (1 / STRETCH))
    angle = _ranged(p, n["rotationrange"] * math.radians(1), random[0] * n["rotation"])
    sine, cosine = p.apply("sin", angle), p.apply("cos", angle)
    scale = p.mix(1.0, _ranged(p, n["scalerange"], random[1]), n["scale"])
    moved = p.mix(n["offsetrange"][0], n["offsetrange"][1], random * n["offset"])
    place = _turned(p, at - center, sine, cosine) / scale + center + moved
    return HexTile(place, [_turned(p, o, sine, cosine) / scale for o in off], weight, angle)


def _gained(p: Program, x: Value, gain: Value) -> Value:
    """Apply the gain function of Schlick 1994, "Fast Alternatives to Perlin's Bias and Gain Functions"."""
    a = (1.0 / p.clamp(gain, 0.001, 0.999) - 2.0) * (1.0 - 2.0 * x)
    return p.select(p.less(x, 0.5), x / (a + 1.0), (a - x) / (a - 1.0))


def tile_weights(n: Node, of: Sequence[HexTile], brightness: Value) -> Value:
    """Return the blending weights of three tiles, which add up to 1."""
    p, one = n.program, n.program.constant(1.0, 1.0, 1.0)
    t = p.pack([tile.weight for tile in of])
    w = brightness * (t * t * t * t * t * t * t)
    w = w / p.dot(w, one)
    falloff = n["falloff"]
    if falloff.constant == (PLAIN_FALLOFF,):
        return w
    gained = _gained(p, w, falloff)
    return p.select(p.apply("equal", falloff, PLAIN_FALLOFF), w, gained / p.dot(gained, one))


def hextiledimage(n: Node) -> Value:
    p, file, default = n.program, n.file("file"), n["default"]
    number = None if file is None else n.around.image(file, n.width, n)
    if number is None:
        return default
    of = hex_tiles(n)
    found = [texel(n, number, tile.at, tile.off, n.width, default) for tile in of]
    one = p.constant(1.0, 1.0, 1.0)
    light = p.pack([p.dot(c.part(0, 3), n["lumacoeffs"]) for c in found])
    by_light = tile_weights(n, of, p.mix(one, light, n["falloffcontrast"]))
    color = _blended([c.part(0, 3) for c in found], by_light)
    if n.width == 3:
        return color
    return p.pack([color, _blended([c[3] for c in found], tile_weights(n, of, one))])


def _blended(values: Sequence[Value], w: Value) -> Value:
    return values[0] * w[0] + values[1] * w[1] + values[2] * w[2]


def hextilednormalmap(n: Node) -> Value:
    """Blend normal maps by surface gradients.

    Mikkelsen 2020, "Surface Gradient-Based Bump Mapping Framework" (JCGT 9 (3)).
    """
    p, file, normal = n.program, n.file("file"), n["normal"]
    number = None if file is None else n.around.image(file, 3, n)
    of = hex_tiles(n)
    share = tile_weights(n, of, p.constant(1.0, 1.0, 1.0))
    gradient: Value | None = None
    for i, tile in enumerate(of):
        coded = n["default"] if number is None else texel(n, number, tile.at, tile.off, 3, n["default"])
        bent = _bent(n, coded, tile.angle)
        d = p.dot(normal, bent)
        slope = (normal * d - bent) / p.apply("max", p.apply("abs", d), LEAST_COSINE)
        part = slope * p.clamp(share[i], 0.0, 1.0)
        gradient = part if gradient is None else gradient + part
    assert gradient is not None
    return p.normalize(normal - gradient)


def _bent(n: Node, coded: Value, angle: Value) -> Value:
    """Return the normal of a normal map's texel, with the tangents rotated about the normal as the tile is."""
    p, normal = n.program, n["normal"]
    green = p.select(n["flip_g"], 1.0 - coded[1], coded[1])
    x, y, z = (p.pack([coded[0], green, coded[2]]) * 2.0 - 1.0).components
    sine, cosine = p.apply("sin", angle), p.apply("cos", angle)

    def turned(v: Value) -> Value:
        around = v * cosine + p.cross(normal, v) * sine + normal * (p.dot(normal, v) * (1.0 - cosine))
        return around * n["strength"]

    return p.normalize(turned(n["tangent"]) * x + turned(n["bitangent"]) * y + normal * z)


HEXTILE_NODES = {"hextiledimage": hextiledimage, "hextilednormalmap": hextilednormalmap}


SOBEL = 1 / 16  # the scale of MaterialX's Sobel filter over texels


def normalmap(n: Node) -> Value:
    """Decode a normal map in the space of its tangents, which is the world's by default. A texel of 0 is no map."""
    p, coded = n.program, n["in"]
    none = p.apply("equal", p.dot(coded, coded), 0.0)
    x, y, z = p.select(none, p.constant(0.0, 0.0, 1.0), coded * 2.0 - 1.0).components
    scale = p.wide(n["scale"], 2)
    return p.normalize(n["tangent"] * (x * scale[0]) + n["bitangent"] * (y * scale[1]) + n["normal"] * z)


def heighttonormal(n: Node) -> Value:
    """Return the encoded normal of a height field, by finite differences over texture coordinates."""
    p = n.program
    h = [(n.read("in", s) - n.read("in", NO_SHIFT)) * n.read("scale", NO_SHIFT) * SOBEL for s in SLOPE_SHIFTS]
    (u1, v1), (u2, v2) = ((n.read("texcoord", s) - n.read("texcoord", NO_SHIFT)).components for s in SLOPE_SHIFTS)
    area = u1 * v2 - v1 * u2
    slope = p.pack([(v1 * h[1] - h[0] * v2) / area, (h[0] * u2 - u1 * h[1]) / area, p.constant(1.0)])
    return p.normalize(slope) * 0.5 + 0.5


NORMAL_MAP_NODES = {"normalmap": normalmap, "heighttonormal": heighttonormal}
