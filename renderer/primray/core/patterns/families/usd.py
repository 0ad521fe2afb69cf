"""USD's own nodes, UsdUVTexture and UsdTransform2d, by the UsdPreviewSurface specification."""

from __future__ import annotations

import math

from ....description.patterns import TRANSFORM_2D, UV_TEXTURE
from ..node import FOOTPRINT_SHIFTS, NO_SHIFT, Node
from ..program import Value
from .images import texel


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


NODES = {UV_TEXTURE: uv_texture, TRANSFORM_2D: transform_2d}
