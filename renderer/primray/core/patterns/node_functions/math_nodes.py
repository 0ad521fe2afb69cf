"""Nodes of mathematics: arithmetic, matrices, and adjustments of values and colours.

Matrices are stored row-major; vectors are rows on the left.
"""

from __future__ import annotations

import math

from ..program import Node, Program, Value


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


MATH_NODES = {
    "add": add, "subtract": subtract, "modulo": modulo, "fract": fract, "invert": invert, "absval": absval, "sign": sign,
    "floor": floor, "ceil": ceil, "round": round_, "power": power, "sin": sin, "cos": cos, "tan": tan, "asin": asin,
    "acos": acos, "atan2": atan2, "sqrt": sqrt, "ln": ln, "exp": exp, "clamp": clamp, "min": minimum, "max": maximum,
    "normalize": normalize, "magnitude": magnitude, "dotproduct": dotproduct, "crossproduct": crossproduct,
    "rotate2d": rotate2d, "rotate3d": rotate3d,
}  # fmt: skip


def matrix_rows(matrix: Value) -> list[Value]:
    n = 3 if matrix.width == 9 else 4
    return [matrix.part(i * n, n) for i in range(n)]


def row_times(p: Program, row: Value, matrix: Value) -> Value:
    """Multiply a row vector by the first rows of a matrix."""
    of = matrix_rows(matrix)
    result = of[0] * row[0]
    for i in range(1, row.width):
        result = p.apply("multiply_add", of[i], row[i], result)
    return result


def matrix_product(p: Program, a: Value, b: Value) -> Value:
    return p.pack([row_times(p, row, b) for row in matrix_rows(a)])


def determinant_of(p: Program, m: Value) -> Value:
    r = matrix_rows(m)
    if len(r) == 3:
        return p.dot(r[0], p.cross(r[1], r[2]))
    return p.dot(r[0], p.pack([_cofactor(p, r, 0, c) for c in range(4)]))


def _cofactor(p: Program, r: list[Value], row: int, column: int) -> Value:
    """Return a cofactor of a 4 x 4 matrix."""
    left = [p.pack([v[c] for c in range(4) if c != column]) for i, v in enumerate(r) if i != row]
    minor = p.dot(left[0], p.cross(left[1], left[2]))
    return minor if (row + column) % 2 == 0 else 0.0 - minor


def matrix_inverse(p: Program, m: Value) -> Value:
    """Return the inverse by cofactors; 0 for a singular matrix."""
    r = matrix_rows(m)
    n = len(r)
    if n == 3:
        crosses = [p.cross(r[1], r[2]), p.cross(r[2], r[0]), p.cross(r[0], r[1])]
        adjugate = p.pack([crosses[j][i] for i in range(3) for j in range(3)])
    else:
        adjugate = p.pack([_cofactor(p, r, j, i) for i in range(4) for j in range(4)])
    return adjugate / determinant_of(p, m)


def multiply(n: Node) -> Value:
    a, b = n["in1"], n["in2"]
    return matrix_product(n.program, a, b) if a.width > 4 and b.width > 4 else a * b


def divide(n: Node) -> Value:
    a, b = n["in1"], n["in2"]
    return matrix_product(n.program, a, matrix_inverse(n.program, b)) if a.width > 4 and b.width > 4 else a / b


def transpose(n: Node) -> Value:
    of = matrix_rows(n["in"])
    return n.program.pack([row[c] for c in range(len(of)) for row in of])


def determinant(n: Node) -> Value:
    return determinant_of(n.program, n["in"])


def invertmatrix(n: Node) -> Value:
    return matrix_inverse(n.program, n["in"])


def creatematrix(n: Node) -> Value:
    p = n.program
    given = [n[name] for name in ("in1", "in2", "in3", "in4") if n.has(name)]
    if n.type == "matrix44" and given[0].width == 3:
        return p.pack([part for i, row in enumerate(given) for part in (row, p.constant(float(i == 3)))])
    return p.pack(given)


def transformmatrix(n: Node) -> Value:
    """Transform a vector; one that is a number shorter than the matrix is a point."""
    p, v, m = n.program, n["in"], n["mat"]
    if v.width == len(matrix_rows(m)):
        return row_times(p, v, m)
    return row_times(p, p.pack([v, p.constant(1.0)]), m).part(0, v.width)


MATRIX_NODES = {
    "multiply": multiply, "divide": divide, "transpose": transpose, "determinant": determinant, "invertmatrix": invertmatrix,
    "creatematrix": creatematrix, "transformmatrix": transformmatrix,
}  # fmt: skip


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


ADJUSTMENT_NODES = {
    "remap": remap, "smoothstep": smoothstep, "luminance": luminance, "rgbtohsv": rgbtohsv, "hsvtorgb": hsvtorgb,
}  # fmt: skip
