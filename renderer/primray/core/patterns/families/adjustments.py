"""Nodes that adjust values and colours."""

from __future__ import annotations

from ..node import Node
from ..program import Program, Value

LEAST_SATURATION = 1e-4  # below it a colour is grey


def remap(n: Node) -> Value:
    low, out_low = n["inlow"], n["outlow"]
    return out_low + (n["in"] - low) * (n["outhigh"] - out_low) / (n["inhigh"] - low)


def smoothstep(n: Node) -> Value:
    p, x, low, high = n.program, n["in"], n["low"], n["high"]
    t = p.clamp((x - low) / (high - low), 0.0, 1.0)
    inside = t * t * (3.0 - 2.0 * t)
    return p.select(p.not_above(high, x), 1.0, p.select(p.not_above(x, low), 0.0, inside))


def luminance(n: Node) -> Value:
    p, c = n.program, n["in"]
    grey = p.wide(p.dot(c.part(0, 3), n["lumacoeffs"]), 3)
    return p.pack([grey, *c.components[3:]])


def _hue(p: Program, c: Value, most: Value, delta: Value) -> Value:
    r, g, b = c.components
    of_blue = 4.0 + (r - g) / delta
    of_green = 2.0 + (b - r) / delta
    h = p.select(p.not_above(most, r), (g - b) / delta, p.select(p.not_above(most, g), of_green, of_blue)) * (1 / 6)
    return p.select(p.less(h, 0.0), h + 1.0, h)


def rgbtohsv(n: Node) -> Value:
    """Convert RGB to HSV by Foley and van Dam's hexcone model."""
    p, c = n.program, n["in"].part(0, 3)
    r, g, b = c.components
    most, least = p.apply("max", r, p.apply("max", g, b)), p.apply("min", r, p.apply("min", g, b))
    delta = most - least
    saturation = p.select(p.less(0.0, most), delta / most, 0.0)
    hue = p.select(p.less(0.0, saturation), _hue(p, c, most, delta), 0.0)
    return p.pack([hue, saturation, most, *n["in"].components[3:]])


def hsvtorgb(n: Node) -> Value:
    p = n.program
    hue, s, v, *alpha = n["in"].components
    h = 6.0 * p.fract(hue)
    sector = p.floor(h)
    f = h - sector
    low, falling, rising = v * (1.0 - s), v * (1.0 - s * f), v * (1.0 - s * (1.0 - f))
    sectors = [(v, rising, low), (falling, v, low), (low, v, rising), (low, falling, v), (rising, low, v), (v, low, falling)]
    color = p.pack(sectors[5])
    for i in range(4, -1, -1):
        color = p.select(p.less(sector, i + 0.5), p.pack(sectors[i]), color)
    return p.pack([p.select(p.less(s, LEAST_SATURATION), v, color), *alpha])


NODES = {
    "remap": remap, "smoothstep": smoothstep, "luminance": luminance, "rgbtohsv": rgbtohsv, "hsvtorgb": hsvtorgb,
}  # fmt: skip
