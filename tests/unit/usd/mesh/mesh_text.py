"""A mesh of two faces as text, translated."""

from __future__ import annotations

QUADS = """def Mesh "mesh"EXTRA
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 3]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0.5, 0)]
    BODY
}
"""
