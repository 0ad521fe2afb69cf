"""Nodes of matrices, which are stored row-major; vectors are rows on the left."""

from __future__ import annotations

from ..node import Node
from ..program import Program, Value


def rows(matrix: Value) -> list[Value]:
    n = 3 if matrix.width == 9 else 4
    return [matrix.part(i * n, n) for i in range(n)]


def row_times(p: Program, row: Value, matrix: Value) -> Value:
    """Multiply a row vector by the first rows of a matrix."""
    of = rows(matrix)
    result = of[0] * row[0]
    for i in range(1, row.width):
        result = p.apply("multiply_add", of[i], row[i], result)
    return result


def product(p: Program, a: Value, b: Value) -> Value:
    return p.pack([row_times(p, row, b) for row in rows(a)])


def determinant_of(p: Program, m: Value) -> Value:
    r = rows(m)
    if len(r) == 3:
        return p.dot(r[0], p.cross(r[1], r[2]))
    return p.dot(r[0], p.pack([_cofactor(p, r, 0, c) for c in range(4)]))


def _cofactor(p: Program, r: list[Value], row: int, column: int) -> Value:
    """Return a cofactor of a 4 x 4 matrix."""
    left = [p.pack([v[c] for c in range(4) if c != column]) for i, v in enumerate(r) if i != row]
    minor = p.dot(left[0], p.cross(left[1], left[2]))
    return minor if (row + column) % 2 == 0 else 0.0 - minor


def inverse(p: Program, m: Value) -> Value:
    """Return the inverse by cofactors; 0 for a singular matrix."""
    r = rows(m)
    n = len(r)
    if n == 3:
        crosses = [p.cross(r[1], r[2]), p.cross(r[2], r[0]), p.cross(r[0], r[1])]
        adjugate = p.pack([crosses[j][i] for i in range(3) for j in range(3)])
    else:
        adjugate = p.pack([_cofactor(p, r, j, i) for i in range(4) for j in range(4)])
    return adjugate / determinant_of(p, m)


def multiply(n: Node) -> Value:
    a, b = n["in1"], n["in2"]
    return product(n.program, a, b) if a.width > 4 and b.width > 4 else a * b


def divide(n: Node) -> Value:
    a, b = n["in1"], n["in2"]
    return product(n.program, a, inverse(n.program, b)) if a.width > 4 and b.width > 4 else a / b


def transpose(n: Node) -> Value:
    of = rows(n["in"])
    return n.program.pack([row[c] for c in range(len(of)) for row in of])


def determinant(n: Node) -> Value:
    return determinant_of(n.program, n["in"])


def invertmatrix(n: Node) -> Value:
    return inverse(n.program, n["in"])


def creatematrix(n: Node) -> Value:
    p = n.program
    given = [n[name] for name in ("in1", "in2", "in3", "in4") if n.has(name)]
    if n.type == "matrix44" and given[0].width == 3:
        return p.pack([part for i, row in enumerate(given) for part in (row, p.constant(float(i == 3)))])
    return p.pack(given)


def transformmatrix(n: Node) -> Value:
    """Transform a vector; one that is a number shorter than the matrix is a point."""
    p, v, m = n.program, n["in"], n["mat"]
    if v.width == len(rows(m)):
        return row_times(p, v, m)
    return row_times(p, p.pack([v, p.constant(1.0)]), m).part(0, v.width)


NODES = {
    "multiply": multiply, "divide": divide, "transpose": transpose, "determinant": determinant, "invertmatrix": invertmatrix,
    "creatematrix": creatematrix, "transformmatrix": transformmatrix,
}  # fmt: skip
