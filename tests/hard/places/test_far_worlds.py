"""The same scene far from the origin: geometry, lights and camera moved together by double-precision operations.

A double at 1e10 holds 2e-6 units, which is 1/30,000 of a pixel in these pictures: the camera is about 10 units away, pixels are
0.065 units there. Whatever is left beyond that is the renderer's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import OpenImageIO as oiio
import pytest
from tests.hard.places.placed_scenes import CUBE, Doubles, apart, bound, problems, shot

from primray.images.image import Image

DISTANCES = (1e4, 1e6, 1e8, 1e10)
DIRECTION = np.array([1.0, -0.7123, 0.3217])
SIZE = (64, 48)

CAMERA = """def Camera "eye"
{
    double3 xformOp:translate = (0.3, 1.7, 10)
    float xformOp:rotateX = -8
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    float2 clippingRange = (0.1, 1000)
}
"""
SCENE = (
    """def Mesh "ground" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    rel material:binding = <%(root)s/checks>
}
def Material "checks"
{
    token outputs:surface.connect = <%(root)s/checks/surface.outputs:surface>
    def Shader "surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = <%(root)s/checks/texture.outputs:rgb>
        float inputs:roughness = 0.4
        token outputs:surface
    }
    def Shader "texture"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @%(texture)s@
        token inputs:sourceColorSpace = "raw"
        float2 inputs:st.connect = <%(root)s/checks/st.outputs:result>
        float3 outputs:rgb
    }
    def Shader "st"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
def Mesh "block"
{
    double3 xformOp:translate = (-1.4, 0.7, 0)
    float3 xformOp:rotateXYZ = (10, 35, 5)
    float3 xformOp:scale = (0.6, 0.6, 0.6)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
    color3f[] primvars:displayColor = [(0.8, 0.3, 0.2)]
    """
    + CUBE
    + """
}
def Sphere "ball"
{
    double radius = 0.7
    double3 xformOp:translate = (1.2, 0.8, 0.4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    color3f[] primvars:displayColor = [(0.2, 0.4, 0.8)]
}
def PointInstancer "crumbs"
{
    rel prototypes = <%(root)s/crumbs/crumb>
    int[] protoIndices = [0, 0, 0, 0]
    point3f[] positions = [(-0.2, 0.3, 1.6), (0.5, 0.25, 1.9), (0, 0.3, -1), (2.2, 0.3, 1.2)]
    quath[] orientations = [(1, 0, 0, 0), (0.9, 0.1, 0.3, 0), (0.7, 0, 0.7, 0.1), (0.5, 0.5, 0.2, 0.6)]
    float3[] scales = [(0.3, 0.3, 0.3), (0.2, 0.25, 0.3), (0.25, 0.3, 0.2), (0.2, 0.3, 0.2)]
    def Mesh "crumb"
    {
        """
    + CUBE
    + """
    }
}
def RectLight "lamp"
{
    float inputs:width = 2
    float inputs:height = 1
    float inputs:intensity = 20
    double3 xformOp:translate = (-2, 5, 3)
    float3 xformOp:rotateXYZ = (-60, -20, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def SphereLight "bulb"
{
    float inputs:radius = 0.2
    float inputs:intensity = 30
    double3 xformOp:translate = (2.5, 2, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DistantLight "sun"
{
    float inputs:intensity = 1
    float inputs:angle = 0
    float3 xformOp:rotateXYZ = (-40, 30, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""
)


@pytest.fixture(scope="module")
def texture(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A checker board of 16 fields a side."""
    file = tmp_path_factory.mktemp("far") / "checks.png"
    light = (np.indices((64, 64)) // 4).sum(axis=0) % 2 == 0
    out = oiio.ImageOutput.create(str(file))
    assert out is not None
    assert out.open(str(file), oiio.ImageSpec(64, 64, 3, "uint8"))
    assert out.write_image(np.repeat(np.where(light, 180, 50)[..., None], 3, axis=2).astype(np.uint8))
    out.close()
    return str(file)


def triple(v: Doubles) -> str:
    return "({!r}, {!r}, {!r})".format(*v.tolist())


def xform(name: str, ops: dict[str, str], inside: str, kind: str = "Xform") -> str:
    """A prim with these operations (type and name, value)."""
    order = ", ".join(f'"{op.split()[1]}"' for op in ops)
    lines = "\n".join(f"{op} = {value}" for op, value in ops.items())
    return f'def {kind} "{name}"\n{{\n{lines}\nuniform token[] xformOpOrder = [{order}]\n{inside}\n}}\n'


def moved(inside: str, by: Doubles, name: str = "world") -> str:
    return xform(name, {"double3 xformOp:translate": triple(by)}, inside)


# Each puts the same things at the same places of the picture, with numbers as large as `distance` on the way. Paths in `inside`
# start with %(root)s.


def by_the_root(inside: str, camera: str, distance: float) -> str:
    return moved(inside % {"root": "/world"} + camera, DIRECTION * distance)


def there_and_back(inside: str, camera: str, distance: float) -> str:
    """Moved, turned, moved back and turned back, all of it in a world that is far away itself."""
    c, s = math.cos(math.radians(37)), math.sin(math.radians(37))
    undo = -np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ (DIRECTION * distance)
    ops = {"double3 xformOp:translate": triple(undo), "double xformOp:rotateZ": "-37"}
    near = xform("near", ops, inside % {"root": "/world/far/turned/near"})
    turned = xform("turned", {"double xformOp:rotateZ": "37"}, near)
    return moved(moved(turned, DIRECTION * distance, "far") + camera, DIRECTION[::-1] * distance)


def native_instances(inside: str, camera: str, distance: float) -> str:
    """What is instanced lies far from its own origin, on the side that the instances undo; a second one is out of view."""
    toy = moved(inside % {"root": "/_toy/inner"}, DIRECTION * -distance, "inner")
    aside = DIRECTION * distance + [0, 0, 60]
    instances = "".join(
        xform(name, {"double3 xformOp:translate": triple(at)}, "").replace(
            f'"{name}"', f'"{name}" (prepend references = </_toy>\ninstanceable = true)', 1
        )
        for name, at in (("one", DIRECTION * distance), ("other", aside))
    )
    return f'class Xform "_toy"\n{{\n{toy}}}\n' + moved(instances + camera, DIRECTION[::-1] * distance)


def point_instancer(inside: str, camera: str, distance: float) -> str:
    """The same with positions in float, which are small: what is large stands in double above and below."""
    toy = xform("toy", {}, moved(inside % {"root": "/world/many/toy/inner"}, DIRECTION * -distance, "inner"))
    lines = "rel prototypes = </world/many/toy>\nint[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (0, 0, 60)]\n"
    many = xform("many", {"double3 xformOp:translate": triple(DIRECTION * distance)}, lines + toy, "PointInstancer")
    return moved(many + camera, DIRECTION[::-1] * distance)


def nested_instancers(inside: str, camera: str, distance: float) -> str:
    """An instancer as the prototype of another, each with moves of its own that undo each other."""
    root = "/world/outer/inner"
    toy = xform("toy", {}, moved(inside % {"root": f"{root}/toy/deep"}, DIRECTION * distance, "deep"))
    lines = "rel prototypes = <%s>\nint[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (0, 0, %d)]\n"
    inner_ops = {"double3 xformOp:translate": triple(DIRECTION * (-3 * distance))}
    inner = xform("inner", inner_ops, lines % (f"{root}/toy", 60) + toy, "PointInstancer")
    outer_ops = {"double3 xformOp:translate": triple(DIRECTION * (2 * distance))}
    outer = xform("outer", outer_ops, lines % (root, 90) + inner, "PointInstancer")
    return moved(outer + camera, DIRECTION[::-1] * distance)


WAYS = (by_the_root, there_and_back, native_instances, point_instancer, nested_instancers)
Way = Callable[[str, str, float], str]


def name_of(way: Way) -> str:
    return way.__name__.replace("_", " ")


def picture(way: Way, distance: float, texture: str, seed: int = 0) -> Image:
    text = way(SCENE.replace("%(texture)s", texture), CAMERA, distance)
    image = shot(text, resolution=SIZE, seed=seed)
    assert problems(image) == []
    return image


@cache
def at_origin(way: Way, texture: str, seed: int) -> Image:
    return picture(way, 0.0, texture, seed)


@pytest.mark.hard_case(
    "Far worlds",
    "geometry, lights, instances and camera 1e4, 1e6, 1e8 and 1e10 units away: %s",
    expected="the picture at 0 within its Monte Carlo error: at most 1 in units of its variance",
    plain_float="a float at 1e8 holds 8 units: nothing of the scene is left",
)
@pytest.mark.parametrize("way", WAYS, ids=name_of)
def test_moved(way: Way, texture: str, measured) -> None:
    expected, again = at_origin(way, texture, 0), at_origin(way, texture, 1)
    assert expected.pixels[..., :3].mean() > 0.1
    found = [apart(picture(way, distance, texture), expected, again) for distance in DISTANCES]
    assert max(found) < 1e-3  # the same random numbers: nearly every sample is the same
    measured(f"{bound(max(found))} of the variance (the same random numbers)")


# Two edges that cross every row of the picture, in the plane z = 0: (x at y = -1, x at y = 1).
LEFT, RIGHT = (-1.1, -0.7), (1.3, 0.9)
WEDGE = f"""def Mesh "wedge"
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    uniform bool doubleSided = 1
    point3f[] points = [({LEFT[0]}, -1, 0), ({RIGHT[0]}, -1, 0), ({RIGHT[1]}, 1, 0), ({LEFT[1]}, 1, 0)]
}}
"""
# The picture's height is 1.6 units at z = 0, its width 3.2.
STRAIGHT = """def Camera "eye"
{
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    float2 clippingRange = (0.1, 1000)
    float horizontalAperture = 16
    float verticalAperture = 8
    float focalLength = 50
}
"""
EDGE_SIZE = (64, 32)


def edges(way: Way, distance: float) -> Doubles:
    """(rows, 2): where the edges cross the middle of each row, in pixels, from the coverage to both sides of the middle."""
    text = way(WEDGE, STRAIGHT, distance)
    image = shot(text, resolution=EDGE_SIZE, spp=256, max_depth=1, default_light=False)
    assert problems(image) == []
    middle = EDGE_SIZE[0] // 2
    coverage = image.pixels[..., 3].astype(np.float64)
    return np.stack([middle - coverage[:, :middle].sum(axis=1), middle + coverage[:, middle:].sum(axis=1)], axis=1)


def exact_edges() -> Doubles:
    y = 0.8 - (np.arange(EDGE_SIZE[1]) + 0.5) * (1.6 / EDGE_SIZE[1])
    at = [a + (b - a) * (y + 1) / 2 for a, b in (LEFT, RIGHT)]
    return (np.stack(at, axis=1) + 1.6) * (EDGE_SIZE[0] / 3.2)


def float_edges(distance: float) -> float:
    """How far the wedge's corners move on the picture when they and the camera are rounded to float: pixels."""
    at = DIRECTION * distance
    corners = np.array([[LEFT[0], -1, 0], [RIGHT[0], -1, 0], [RIGHT[1], 1, 0], [LEFT[1], 1, 0]])
    true = corners - [0, 0, 10]
    rounded = (corners + at).astype(np.float32).astype(np.float64) - (at + [0, 0, 10]).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(rounded[:, :2] / -rounded[:, 2:] - true[:, :2] / -true[:, 2:]).max() * 10 * EDGE_SIZE[0] / 3.2
    return float(off) if np.isfinite(off) else math.inf


@pytest.mark.hard_case(
    "Far worlds",
    "edges on the picture, 1e4, 1e6, 1e8 and 1e10 units away: %s",
    expected="where they are at 0, to 0.01 pixel",
    plain_float="corners rounded to float: 0.008 pixel off at 1e4, 0.5 at 1e6, 26 at 1e8; nothing left at 1e10",
)
@pytest.mark.parametrize("way", WAYS, ids=name_of)
def test_edges(way: Way, measured) -> None:
    near = edges(way, 0.0)
    assert np.abs(near - exact_edges()).max() < 0.03  # what 256 samples a pixel tell of one row
    assert np.abs((near - exact_edges()).mean(axis=0)).max() < 3e-3
    found = {distance: edges(way, distance) for distance in DISTANCES}
    off = [float(np.abs(found[distance] - near).max()) for distance in DISTANCES]
    assert max(off) < 0.01
    # With the samples' own error averaged over the rows.
    exact = max(np.abs((found[distance] - exact_edges()).mean(axis=0)).max() for distance in DISTANCES)
    assert exact < 3e-3
    measured("the same samples covered at all distances" if max(off) == 0 else f"{bound(max(off))} pixel off")
