"""Two rooms whose light is almost all indirect, as USD: lit through a door ajar, and by a lamp that shines at the ceiling.

python -m tests.bench.stages.indirect FOLDER      # writes door.usda and uplight.usda; camera /World/cam, 320 x 240, depth 12
"""

from __future__ import annotations

import sys
from pathlib import Path

Point = tuple[float, float, float]
Quad = tuple[Point, Point, Point, Point]

RESOLUTION = (320, 240)
MAX_DEPTH = 12
COLORS = {"white": (0.75, 0.73, 0.7), "wood": (0.45, 0.28, 0.15), "blue": (0.2, 0.3, 0.55), "floor": (0.5, 0.45, 0.4)}


def box(low: Point, high: Point) -> list[Quad]:
    """The six sides, seen from both."""
    (x, y, z), (X, Y, Z) = low, high
    return [
        ((x, y, z), (X, y, z), (X, Y, z), (x, Y, z)),
        ((x, y, Z), (X, y, Z), (X, Y, Z), (x, Y, Z)),
        ((x, y, z), (x, Y, z), (x, Y, Z), (x, y, Z)),
        ((X, y, z), (X, Y, z), (X, Y, Z), (X, y, Z)),
        ((x, y, z), (x, y, Z), (X, y, Z), (X, y, z)),
        ((x, Y, z), (x, Y, Z), (X, Y, Z), (X, Y, z)),
    ]


def mesh(name: str, quads: list[Quad], color: str) -> str:
    points = ", ".join(f"({x:g}, {y:g}, {z:g})" for quad in quads for x, y, z in quad)
    return f"""
    def Mesh "{name}" {{
        int[] faceVertexCounts = [{", ".join(["4"] * len(quads))}]
        int[] faceVertexIndices = [{", ".join(str(i) for i in range(4 * len(quads)))}]
        point3f[] points = [{points}]
        uniform token subdivisionScheme = "none"
        color3f[] primvars:displayColor = [{COLORS[color]}]
    }}"""


def lamp(center: Point, size: tuple[float, float], intensity: float, up: bool) -> str:
    """A rectangle that shines down, or up."""
    return f"""
    def RectLight "lamp" {{
        float inputs:width = {size[0]:g}
        float inputs:height = {size[1]:g}
        float inputs:intensity = {intensity:g}
        color3f inputs:color = (1, 0.9, 0.75)
        double3 xformOp:translate = {center}
        float xformOp:rotateX = {90 if up else -90}
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }}"""


def stage(eye: Point, pitch: float, yaw: float, prims: list[str]) -> str:
    return f"""#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
    defaultPrim = "World"
)
def Xform "World" {{
    def Camera "cam" {{
        float focalLength = 20
        float horizontalAperture = 24
        float verticalAperture = 18
        float2 clippingRange = (0.01, 100)
        double3 xformOp:translate = {eye}
        float3 xformOp:rotateYXZ = ({pitch:g}, {yaw:g}, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateYXZ"]
    }}{"".join(prims)}
}}
"""


FURNITURE = [
    mesh("table", box((-1.2, 0.7, -0.6), (0.2, 0.76, 0.5)), "wood"),
    mesh("legs", [q for x in (-1.15, 0.1) for z in (-0.55, 0.42) for q in box((x, 0, z), (x + 0.06, 0.7, z + 0.06))], "wood"),
    mesh("chest", box((-1.9, 0, -1.9), (-0.7, 0.9, -1.4)), "blue"),
    mesh("things", [*box((-0.9, 0.76, -0.2), (-0.6, 1.05, 0.1)), *box((-0.3, 0.76, -0.3), (-0.1, 0.95, -0.1))], "white"),
]


def uplight() -> str:
    """A room of 4 x 2.6 x 4 with a lamp on the chest that shines at the ceiling."""
    room = mesh("room", box((-2, 0, -2), (2, 2.6, 2))[2:], "white")
    ends = mesh("ends", box((-2, 0, -2), (2, 2.6, 2))[:2], "white")
    bowl = mesh("bowl", box((-1.55, 1.5, -1.85), (-1.05, 1.7, -1.45))[:5], "wood")
    prims = [room, ends, bowl, *FURNITURE, lamp((-1.3, 1.6, -1.65), (0.3, 0.2), 120, up=True)]
    return stage((1.4, 1.5, 1.8), -12, 35, prims)


def door() -> str:
    """The same room, dark, beside a lit one; the door between them stands a hand's breadth open."""
    floor = mesh("floor", [((-2, 0, -2), (6, 0, -2), (6, 0, 2), (-2, 0, 2))], "floor")
    ceiling = mesh("ceiling", [((-2, 2.6, -2), (6, 2.6, -2), (6, 2.6, 2), (-2, 2.6, 2))], "white")
    walls = mesh(
        "walls",
        [
            ((-2, 0, -2), (6, 0, -2), (6, 2.6, -2), (-2, 2.6, -2)),
            ((-2, 0, 2), (6, 0, 2), (6, 2.6, 2), (-2, 2.6, 2)),
            ((-2, 0, -2), (-2, 0, 2), (-2, 2.6, 2), (-2, 2.6, -2)),
            ((6, 0, -2), (6, 0, 2), (6, 2.6, 2), (6, 2.6, -2)),
        ],
        "white",
    )
    # Between the rooms, with a doorway from z = -1.5 to z = -0.6.
    between = mesh(
        "between",
        [
            *box((2, 0, -2), (2.1, 2.6, -1.5)),
            *box((2, 0, -0.6), (2.1, 2.6, 2)),
            *box((2, 2.1, -1.5), (2.1, 2.6, -0.6)),
        ],
        "white",
    )
    leaf = mesh("leaf", box((2.02, 0, -1.25), (2.06, 2.1, -0.6)), "wood")
    prims = [floor, ceiling, walls, between, leaf, *FURNITURE, lamp((4.2, 2.58, 0), (0.8, 0.8), 1000, up=False)]
    return stage((1.6, 1.5, 1.8), -10, 35, prims)


def write(folder: Path) -> dict[str, Path]:
    folder.mkdir(parents=True, exist_ok=True)
    paths = {}
    for name, text in (("uplight", uplight()), ("door", door())):
        paths[name] = folder / f"{name}.usda"
        paths[name].write_text(text)
    return paths


if __name__ == "__main__":
    for path in write(Path(sys.argv[1])).values():
        print(path)
