"""Nodes of arithmetic: sums, powers, angles, rounding, lengths."""

from __future__ import annotations

import math

from ..node import Node
from ..program import Value


def add(n: Node) -> Value:
    return n["in1"] + n["in2"]


def subtract(n: Node) -> Value:
    return n["in1"] - n["in2"]


def modulo(n: Node) -> Value:
    """Return the remainder of flooring division, with the sign of the divisor."""
    a, b = n["in1"], n["in2"]
    return a - b * n.program.floor(a / b)


def fract(n: Node) -> Value:
    return n.program.fract(n["in"])


def invert(n: Node) -> Value:
    return n["amount"] - n["in"]


def absval(n: Node) -> Value:
    return n.program.apply("abs", n["in"])


def sign(n: Node) -> Value:
    x = n["in"]
    return n.program.less(0.0, x) - n.program.less(x, 0.0)


def floor(n: Node) -> Value:
    return n.program.floor(n["in"])


def ceil(n: Node) -> Value:
    return 0.0 - n.program.floor(0.0 - n["in"])


def round_(n: Node) -> Value:
    """Round halves up."""
    return n.program.floor(n["in"] + 0.5)


def power(n: Node) -> Value:
    return n.program.apply("power", n["in1"], n["in2"])


def sin(n: Node) -> Value:
    return n.program.apply("sin", n["in"])


def cos(n: Node) -> Value:
    return n.program.apply("cos", n["in"])


def tan(n: Node) -> Value:
    return sin(n) / cos(n)


def asin(n: Node) -> Value:
    return n.program.apply("asin", n["in"])


def acos(n: Node) -> Value:
    return n.program.apply("acos", n["in"])


def atan2(n: Node) -> Value:
    return n.program.apply("atan2", n["iny"], n["inx"])


def sqrt(n: Node) -> Value:
    return n.program.sqrt(n["in"])


def ln(n: Node) -> Value:
    return n.program.apply("ln", n["in"])


def exp(n: Node) -> Value:
    return n.program.apply("exp", n["in"])


def clamp(n: Node) -> Value:
    return n.program.clamp(n["in"], n["low"], n["high"])


def minimum(n: Node) -> Value:
    return n.program.apply("min", n["in1"], n["in2"])


def maximum(n: Node) -> Value:
    return n.program.apply("max", n["in1"], n["in2"])


def normalize(n: Node) -> Value:
    return n.program.normalize(n["in"])


def magnitude(n: Node) -> Value:
    return n.program.sqrt(n.program.dot(n["in"], n["in"]))


def dotproduct(n: Node) -> Value:
    return n.program.dot(n["in1"], n["in2"])


def crossproduct(n: Node) -> Value:
    return n.program.cross(n["in1"], n["in2"])


def rotate2d(n: Node) -> Value:
    """Rotate clockwise by degrees."""
    p, v = n.program, n["in"]
    angle = n["amount"] * math.radians(1)
    s, c = p.apply("sin", angle), p.apply("cos", angle)
    return p.pack([c * v[0] + s * v[1], c * v[1] - s * v[0]])


def rotate3d(n: Node) -> Value:
    """Rotate row vectors by degrees about an axis (Rodrigues' formula)."""
    p, v = n.program, n["in"]
    axis = p.normalize(n["axis"])
    angle = n["amount"] * math.radians(1)
    s, c = p.apply("sin", angle), p.apply("cos", angle)
    return v * c + p.cross(v, axis) * s + axis * (p.dot(axis, v) * (1.0 - c))


NODES = {
    "add": add, "subtract": subtract, "modulo": modulo, "fract": fract, "invert": invert, "absval": absval, "sign": sign,
    "floor": floor, "ceil": ceil, "round": round_, "power": power, "sin": sin, "cos": cos, "tan": tan, "asin": asin,
    "acos": acos, "atan2": atan2, "sqrt": sqrt, "ln": ln, "exp": exp, "clamp": clamp, "min": minimum, "max": maximum,
    "normalize": normalize, "magnitude": magnitude, "dotproduct": dotproduct, "crossproduct": crossproduct,
    "rotate2d": rotate2d, "rotate3d": rotate3d,
}  # fmt: skip
