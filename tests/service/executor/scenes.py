"""Small scenes for the tests of executors and workers."""

from __future__ import annotations

ROOM = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World" {
    def Camera "camera" {
        double3 xformOp:translate = (0, 1, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Sphere "ball" {
        double radius = 1
        double3 xformOp:translate = (0, 1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "ground" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-5, 0, -5), (-5, 0, 5), (5, 0, 5), (5, 0, -5)]
    }
    def RectLight "lamp" {
        float inputs:intensity = 4
        double3 xformOp:translate = (0, 4, 0)
        float3 xformOp:rotateXYZ = (-90, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
}
"""

BROKEN = '#usda 1.0\n\ndef Xform "World" {\n    string secret = "do not tell"\n    double3 oops = (1, 2\n}\n'

MISSING_TEXTURE = ROOM.replace(
    'def RectLight "lamp" {',
    'def DomeLight "sky" {\n        asset inputs:texture:file = @textures/not_there.png@\n    }\n    def RectLight "lamp" {',
)


def reference_bomb(levels: int = 9, wide: int = 10) -> str:
    """3 kB that compose to wide^levels prims."""
    prims = [f'def Xform "L{levels}" {{\n    def Sphere "s" {{\n    }}\n}}']
    for level in range(levels - 1, -1, -1):
        inside = "\n".join(f'    def "p{i}" (references = </L{level + 1}>) {{\n    }}' for i in range(wide))
        prims.append(f'def Xform "L{level}" {{\n{inside}\n}}')
    return '#usda 1.0\n(\n    defaultPrim = "L0"\n)\n' + "\n".join(prims) + "\n"
