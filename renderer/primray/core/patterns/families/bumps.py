"""Nodes that compute normals from normal maps and from heights."""

from __future__ import annotations

from ..node import NO_SHIFT, SLOPE_SHIFTS, Node
from ..program import Value

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


NODES = {"normalmap": normalmap, "heighttonormal": heighttonormal}
