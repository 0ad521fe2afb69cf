"""Faces in the coordinate planes of the point that lengths are measured from: nothing of them rounds, and they are lit.

With a sphere in the scene, since Embree takes a triangle for met at distance 0 only where there are other shapes as well.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.hard.places.placed_scenes import problems, shot

# The camera is nearer to the world's origin than to any other point of the grid that its near plane gives.
STAGE = """def Mesh "plate"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    uniform bool doubleSided = 1
    point3f[] points = [%s]
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
def Sphere "ball"
{
    double radius = 0.01
    double3 xformOp:translate = (0, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}
def DomeLight "sky"
{
}
def Camera "eye"
{
    matrix4d xformOp:transform = %s
    uniform token[] xformOpOrder = ["xformOp:transform"]
    float2 clippingRange = (1, 1000)
}
"""
CORNERS = [(-30, -22), (30, -22), (30, 22), (-30, 22)]  # whose normal rounds


def looks_along(axis: int) -> str:
    """A camera at 3 along the axis and beside the others, looking back."""
    back, right = np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
    rows = [right, np.cross(back, right), back, 3 * back + 0.3 * right]
    return "(" + ", ".join(f"({', '.join(map(repr, map(float, [*row, i == 3])))})" for i, row in enumerate(rows)) + ")"


@pytest.mark.parametrize("axis", [0, 1, 2], ids="xyz")
def test_a_plate_in_the_plane_is_lit(axis: int) -> None:
    points = ", ".join(str(tuple(np.insert(np.array(corner, float), axis, 0.0).tolist())) for corner in CORNERS)
    image = shot(STAGE % (points, looks_along(axis)), spp=64, max_depth=1)
    assert problems(image) == []
    np.testing.assert_allclose(image.pixels[..., :3].mean(axis=(0, 1)), 0.5, rtol=0.01)
