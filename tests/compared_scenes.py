"""Stages that are compared with themselves and with changed versions of themselves: small, and one with rare bright paths."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pxr import Usd

FEATURES = Path(__file__).parents[1] / "scenes" / "features"

# A small lamp that the floor sees through a ball of glass: only a rare scattered ray finds it there.
CAUSTIC = """#usda 1.0
def Camera "eye"
{
    double3 xformOp:translate = (0, 2.2, 6)
    float xformOp:rotateX = -20
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def Mesh "floor"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-5, 0, 5), (5, 0, 5), (5, 0, -5), (-5, 0, -5)]
    uniform token subdivisionScheme = "none"
}
def Sphere "ball" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    double radius = 0.8
    rel material:binding = </glass>
    double3 xformOp:translate = (0, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def SphereLight "bulb"
{
    float inputs:intensity = 2000
    float inputs:radius = 0.06
    double3 xformOp:translate = (1.5, 3.5, -0.5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Material "glass"
{
    token outputs:surface.connect = </glass/shader.outputs:surface>
    def Shader "shader"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity = 0
        float inputs:roughness = 0
        token outputs:surface
    }
}
"""

# A floor with a small ball and a box in the light of a lamp and a weak sky; %-values are what tests change.
ROOM = """#usda 1.0
def Camera "eye"
{
    float focalLength = 26
    double3 xformOp:translate = (0, 2.2, 6)
    float xformOp:rotateX = -20
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def Mesh "floor"
{
    color3f[] primvars:displayColor = [(0.5, 0.45, 0.4)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, 0, 6), (9, 0, 6), (9, 0, -9), (-9, 0, -9)]
    uniform token subdivisionScheme = "none"
}
def Sphere "ball"
{
    color3f[] primvars:displayColor = [(0.2, 0.3, 0.7)]
    double radius = 0.7
    double3 xformOp:translate = (%(ball_x)s, 0.7, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Cube "die"
{
    color3f[] primvars:displayColor = [(0.8, 0.1, 0.1)]
    token visibility = "%(die)s"
    double size = 0.3
    double3 xformOp:translate = (1.1, 0.15, 1.5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "mat"
{
    color3f[] primvars:displayColor = [(%(mat)s, %(mat)s, %(mat)s)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1.9, 0.001, 1.6), (-1.2, 0.001, 1.6), (-1.2, 0.001, 0.9), (-1.9, 0.001, 0.9)]
    uniform token subdivisionScheme = "none"
}
def Mesh "wall"
{
    color3f[] primvars:displayColor = [%(wall)s] (
        interpolation = "uniform"
    )
    int[] faceVertexCounts = [4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 6, 5, 1, 2, 7, 6, 2, 3, 8, 7, 3, 4, 9, 8]
    point3f[] points = [(-4, 0, -4), (-2, 0, -4), (0, 0, -4), (2, 0, -4), (4, 0, -4),
                        (-4, 3, -4), (-2, 3, -4), (0, 3, -4), (2, 3, -4), (4, 3, -4)]
    uniform token subdivisionScheme = "none"
}
def RectLight "lamp"
{
    float inputs:intensity = %(intensity)s
    float inputs:width = 1.5
    float inputs:height = 1.5
    double3 xformOp:translate = (1, 4, 1)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def DomeLight "sky"
{
    float inputs:intensity = 0.1
}
"""
PLAIN: dict[str, Any] = {
    "ball_x": 0,
    "die": "inherited",
    "mat": 0.4,
    "wall": "(0.6, 0.2, 0.2), (0.2, 0.6, 0.2), (0.2, 0.2, 0.6), (0.6, 0.6, 0.6)",
    "intensity": 10,
}
# What a pixel covers at the ball, 6.3 from the camera whose focal length is 26 mm on an aperture of 20.955 mm, 64 pixels wide.
PIXEL = 6.3 * 20.955 / 26 / 64
CHANGES: dict[str, dict[str, Any]] = {
    "lamp 2 % brighter": {"intensity": 10.2},
    "ball moved by a pixel": {"ball_x": PIXEL},
    "small box removed": {"die": "invisible"},
    "colours of a wall swapped": {"wall": "(0.6, 0.2, 0.2), (0.2, 0.2, 0.6), (0.2, 0.6, 0.2), (0.6, 0.6, 0.6)"},
    "a patch of floor 10 % darker": {"mat": 0.36},
}


def stage_of(text: str) -> Usd.Stage:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(text)
    return stage


def room(**changes: Any) -> Usd.Stage:
    return stage_of(ROOM % (PLAIN | changes))


def scenes() -> Iterator[tuple[str, Any]]:
    yield "caustic", stage_of(CAUSTIC)
    yield "room", room()
    for name in ("glass", "emission", "opacity-texture", "clearcoat"):
        yield name, str(FEATURES / name / "scene.usda")
