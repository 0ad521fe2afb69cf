"""NurbsPatch prims as text."""

from __future__ import annotations

SPHERE_POINTS = [
    (x * r, y * r, z)
    for r, z in ((0, -1), (1, -1), (1, 0), (1, 1), (0, 1))
    for x, y in ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0))
]
_HALF = 0.5**0.5
SPHERE_WEIGHTS = [a * b for a in (1, _HALF, 1, _HALF, 1) for b in (1, _HALF, 1, _HALF, 1, _HALF, 1, _HALF, 1)]
SPHERE = {
    "int uVertexCount": 9,
    "int vVertexCount": 5,
    "int uOrder": 3,
    "int vOrder": 3,
    "double[] uKnots": [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
    "double[] vKnots": [0, 0, 0, 1, 1, 2, 2, 2],
    "double[] pointWeights": SPHERE_WEIGHTS,
    "point3f[] points": SPHERE_POINTS,
}
PLANE: dict[str, object] = {
    "int uVertexCount": 2,
    "int vVertexCount": 2,
    "int uOrder": 2,
    "int vOrder": 2,
    "double[] uKnots": [0, 0, 1, 1],
    "double[] vKnots": [0, 0, 1, 1],
    "point3f[] points": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)],
}
# A square hole in the middle, of a closed line each of whose sides is a curve's span.
SQUARE = {
    "int[] trimCurve:counts": [1],
    "int[] trimCurve:orders": [2],
    "int[] trimCurve:vertexCounts": [5],
    "double[] trimCurve:knots": [0, 0, 1, 2, 3, 4, 4],
    "double2[] trimCurve:ranges": [(0, 4)],
    "double3[] trimCurve:points": [(0.25, 0.25, 1), (0.75, 0.25, 1), (0.75, 0.75, 1), (0.25, 0.75, 1), (0.25, 0.25, 1)],
}


def patch(values: dict[str, object], more: str = "", name: str = "p") -> str:
    lines = "".join(f"    {key} = {value}\n" for key, value in values.items() if value is not None)
    return f'def NurbsPatch "{name}"\n{{\n{lines}    {more}\n}}\n'
