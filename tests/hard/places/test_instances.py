"""Instances with matrices that are hard on floats, crowds of them in one place, and nesting."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, Vt
from tests.expanded import flat_stage
from tests.hard.places.placed_scenes import CUBE, Doubles, apart, bound, codes, matrix_text, picture_of, problems, stage_of

from primray.description.placement import PointInstances
from primray.images.image import Image

CAMERA = """def Camera "eye"
{
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    float2 clippingRange = (0.1, 1000)
}
"""
LIGHTS = """def DistantLight "sun"
{
    float inputs:intensity = 3
    float inputs:angle = 0
    float3 xformOp:rotateXYZ = (-30, 25, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
def RectLight "lamp"
{
    float inputs:width = 3
    float inputs:height = 3
    float inputs:intensity = 2
    double3 xformOp:translate = (2, 3, 8)
    float3 xformOp:rotateXYZ = (-20, 15, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
"""
WALL = f"""def Mesh "wall"
{{
    float3 xformOp:scale = (4, 3, 0.5)
    double3 xformOp:translate = (0, 0, -2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    {CUBE}
}}
"""
COLOR = "color3f[] primvars:displayColor = [(0.8, 0.4, 0.2)]"
CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
FACES = CUBE[: CUBE.index("    point3f[]")]


def turn(*angles: float) -> Doubles:
    """About x, then y, then z."""
    m = np.eye(3)
    for axis, a in enumerate(angles):
        i, j = [k for k in range(3) if k != axis]
        r = np.eye(3)
        r[i, i] = r[j, j] = np.cos(a)
        r[i, j], r[j, i] = -np.sin(a), np.sin(a)
        m = r @ m
    return m


# What every case should show: a cube turned and sheared, of two units.
SHOWN = turn(0.4, 0.7, 0.2) @ np.array([[0.9, 0.4, 0], [0, 0.9, 0.1], [0, 0, 0.8]])


def faceted(size: Doubles, more: str = "") -> str:
    """A cube whose points are multiplied by `size`."""
    points = ", ".join(repr(tuple(p)) for p in (CORNERS @ size.T).tolist())
    return f"""def Mesh "block"
    {{
        {COLOR}
        {FACES}
        point3f[] points = [{points}]
        {more}
    }}"""


def block(size: Doubles, more: str = "") -> str:
    """The same with smooth normals, which point from its centre to its corners."""
    directions = CORNERS @ np.linalg.inv(size)
    normals = ", ".join(repr(tuple(n)) for n in (directions / np.linalg.norm(directions, axis=1)[:, None]).tolist())
    return faceted(size, f'normal3f[] normals = [{normals}] (interpolation = "vertex")\n{more}')


def placed(name: str, m: Doubles, at: tuple[float, float, float], header: str, inside: str = "") -> str:
    return f"""def Xform "{name}" {header}
{{
    matrix4d xformOp:transform = {matrix_text(np.c_[m, np.array(at)])}
    uniform token[] xformOpOrder = ["xformOp:transform"]
    {inside}
}}
"""


def instanced(m: Doubles, inside: str) -> str:
    """A native instance at the matrix, and a second one out of view: alone it would not be kept as an instance."""
    header = "(\n    prepend references = </_toy>\n    instanceable = true\n)"
    toy = f'class Xform "_toy"\n{{\n    {inside}\n}}\n'
    return toy + placed("one", m, (0, 0, 0), header) + placed("other", m, (0, 0, 60), header)


def plain(m: Doubles, inside: str) -> str:
    return placed("one", m, (0, 0, 0), "", inside)


def picture(text: str, seed: int = 0) -> Image:
    return picture_of(stage_of(text + WALL + LIGHTS + CAMERA + SHINE), seed=seed)


SKEW = turn(0.5, 0.8, 0.1)
# The instance's matrix is SHOWN times the inverse of what the points are multiplied by.
SIZES = {
    "mirrored": np.diag([-1.0, 1, 1]),
    "sheared": np.array([[1, 3.0, 0], [0, 1, 5], [0, 0, 1]]),
    "scaled by 1e6": np.diag([1e-6] * 3),
    "scaled by 1e-6": np.diag([1e6] * 3),
    "scaled by 1e-6, 1 and 1e6": np.diag([1e6, 1, 1e-6]),
    "scaled by 1e-6, 1 and 1e6, mirrored": np.diag([1e6, 1, -1e-6]),
    "scaled by 1e-25": np.diag([1e25] * 3),
    "stretched by 1000 off its axes": SKEW @ np.diag([0.1, 1, 100]) @ turn(0.3, 0, 1.1),
    "stretched by 1000 off its axes, mirrored": SKEW @ np.diag([0.1, 1, -100]) @ turn(0.3, 0, 1.1),
}


@pytest.mark.hard_case(
    "Instances",
    "a native instance %s (its points the other way round)",
    expected="the block placed there unscaled; with smooth normals, the same prim without instancing",
)
@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_matrix(size: Doubles, measured) -> None:
    m = SHOWN @ np.linalg.inv(size)
    found = []
    for one, other in ((plain(SHOWN, faceted(np.eye(3))), faceted(size)), (plain(m, block(size)), block(size))):
        expected, again = (picture(one, seed) for seed in (0, 1))
        image = picture(instanced(m, other))
        assert problems(image) == []
        assert expected.report["scene"]["instances"] == 0
        assert image.report["scene"]["instances"] == 2
        found.append(apart(image, expected, again))
    assert max(found) < 1e-3
    measured(f"{bound(max(found))} of the picture's variance (the same random numbers)")


LEFT_HANDED = 'uniform token orientation = "leftHanded"'


@pytest.mark.hard_case(
    "Instances",
    "a leftHanded block and a glowing square, instanced at 1e-4, %s",
    expected="the picture of the same as a prim of its own, lit by it",
)
@pytest.mark.parametrize("mirror", [1, -1], ids=["as it is", "mirrored"])
def test_handedness_and_emitters(mirror: int, measured) -> None:
    m = SHOWN @ np.diag([1e-4, 1e-4, mirror * 1e-4])
    inside = block(np.eye(3) * 1e4, LEFT_HANDED) + GLOWING
    expected, again = (picture(plain(m, inside), seed) for seed in (0, 1))
    image = picture(instanced(m, inside))
    assert problems(image) == problems(expected) == []
    # Of the two instances' lights one is chosen at random, so pictures agree only in their noise.
    found = apart(image, expected, again)
    assert found < 2
    means = image.pixels.mean(axis=(0, 1)), expected.pixels.mean(axis=(0, 1))
    np.testing.assert_allclose(*means, rtol=0.03)
    measured("within the noise")


GLOWING = """
    def Mesh "glow" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        uniform token subdivisionScheme = "none"
        point3f[] points = [(-20000, 12000, -5000), (-12000, 12000, -5000), (-12000, 20000, -5000), (-20000, 20000, -5000)]
        rel material:binding = </shine>
    }
"""
SHINE = """def Material "shine"
{
    token outputs:surface.connect = </shine/surface.outputs:surface>
    def Shader "surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor = (9, 9, 9)
        token outputs:surface
    }
}
"""


@pytest.mark.hard_case(
    "Instances", "scaled by 0 along %s", expected="flat, as the same prim without instancing is", plain_float="missing"
)
@pytest.mark.parametrize("axis", [0, 2], ids=["x", "z"])
def test_flat(axis: int, measured) -> None:
    m = turn(0.4, 0.7, 0.2) @ np.diag([float(k != axis) for k in range(3)])
    expected, again = (picture(plain(m, block(np.eye(3))), seed) for seed in (0, 1))
    image = picture(instanced(m, block(np.eye(3))))
    assert problems(image) == []
    assert np.mean(np.abs(image.pixels - picture("").pixels) > 0.01) > 0.02  # something is there
    found = apart(image, expected, again)
    assert found < 1e-3
    measured(f"{bound(found)} of the picture's variance")


NOTHING = {"0 along two axes": np.diag([1.0, 0, 0]), "0": np.zeros((3, 3))}
BROKEN = {"NaN": np.diag([np.nan, 1, 1]), "infinity": np.diag([np.inf, 1, 1])}


@pytest.mark.hard_case("Instances", "scaled by %s", expected="not there, and a diagnostic; the rest of the picture as it is")
@pytest.mark.parametrize("m", (NOTHING | BROKEN).values(), ids=NOTHING | BROKEN)
def test_without_volume(m: Doubles, measured) -> None:
    text = instanced(m, block(np.eye(3)))
    image = picture(text)
    assert problems(image) == (["singular-transform"] if np.isfinite(m).all() else ["invalid-transform"])
    np.testing.assert_array_equal(image.pixels, picture("").pixels)
    measured(problems(image)[0])


def crowd(positions: Doubles, scales: Doubles | None = None, inside: str = "") -> Usd.Stage:
    """Cubes of a point instancer."""
    toy = f'    def Xform "toy"\n    {{\n        {block(np.eye(3))}\n        {inside}\n    }}\n'
    stage = stage_of(f'def PointInstancer "crowd"\n{{\n    rel prototypes = </crowd/toy>\n{toy}}}\n' + WALL + LIGHTS + CAMERA)
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/crowd"))
    instancer.CreateProtoIndicesAttr(Vt.IntArray(len(positions), 0))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions.astype(np.float32)))
    if scales is not None:
        instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(scales.astype(np.float32)))
    return stage


@pytest.mark.hard_case(
    "Instances",
    "%s instances in exactly one place",
    expected="the picture of one, the rest left out with a diagnostic",
    plain_float="a ray is tested against each: 1 ms for 10,000 in Embree",
)
@pytest.mark.parametrize("count", [10_000, 1_000_000], ids=["10,000", "1,000,000"])
def test_in_one_place(count: int, measured) -> None:
    one = picture_of(crowd(np.zeros((1, 3))))
    image = picture_of(crowd(np.zeros((count, 3))))
    said = [d for d in image.report["diagnostics"] if d["code"] == "instances-coincident"]
    assert [d["prim_path"] for d in said] == ["/crowd/toy"]
    assert f"{count - 1:,} instances" in said[0]["message"]
    assert said[0]["severity"] == "info"
    np.testing.assert_array_equal(image.pixels, one.pixels)
    measured("the picture of one, bit for bit")


def test_native_instances_and_instancers_in_one_place() -> None:
    header = "(\n    prepend references = </_toy>\n    instanceable = true\n)"
    toy = f'class Xform "_toy"\n{{\n    {block(np.eye(3))}\n}}\n'
    native = toy + "".join(placed(f"i{k}", SHOWN, (0, 0, 0), header) for k in range(50))
    image = picture(native)
    assert "instances-coincident" in codes(image)
    assert image.report["scene"]["instances"] == 0
    each = "\n".join(
        f'def PointInstancer "p{k}"\n{{\nrel prototypes = </_toy>\nint[] protoIndices = [0]\n'
        "point3f[] positions = [(0, 0, 0)]\n}\n"
        for k in range(50)
    )
    assert "instances-coincident" in codes(
        picture(toy.replace("class", "def", 1).replace("_toy", "toy") + each.replace("_toy", "toy"))
    )


def test_what_differs_is_kept() -> None:
    """Instances that differ in anything, and lights, which add up."""
    scales = np.ones((64, 3))
    scales[1::2] = 0.5
    image = picture_of(crowd(np.zeros((64, 3)), scales))
    assert image.report["scene"]["instances"] == 2
    bulb = 'def SphereLight "bulb"\n{\nfloat inputs:radius = 0.01\n}'
    lit = picture_of(crowd(np.zeros((40, 3)), inside=bulb))
    assert "instances-coincident" not in codes(lit)


@pytest.mark.hard_case(
    "Instances",
    "10,000 instances within 1e-5 units of one place",
    expected="the picture of one; slow (1 ms a ray), not stuck",
)
def test_nearly_in_one_place(measured) -> None:
    offsets = np.random.default_rng(0).uniform(-5e-6, 5e-6, (10_000, 3))
    one, image = (picture_of(crowd(at), resolution=(6, 4), spp=1, max_depth=1) for at in (np.zeros((1, 3)), offsets))
    assert "instances-coincident" not in codes(image)
    assert image.report["scene"]["instances"] == 10_000
    assert problems(image) == []
    np.testing.assert_allclose(image.pixels, one.pixels, atol=1e-3)
    measured("the picture of one to 1e-3")


@pytest.mark.hard_case("Meshes", "two and three equal opaque meshes in one place", expected="the picture of one")
def test_equal_meshes_in_one_place(measured) -> None:
    one, *more = (
        picture("".join(placed(f"copy{k}", SHOWN, (0, 0, 0), "", block(np.eye(3))) for k in range(n))) for n in (1, 2, 3)
    )
    for image in more:
        np.testing.assert_array_equal(image.pixels, one.pixels)
    measured("the same picture, bit for bit")


DEPTH = 20
STEP = (
    "double3 xformOp:translate = (0.21, 0.05, -0.1)\n double xformOp:rotateZ = 9\n double3 xformOp:scale = (0.97, 1.01, -0.98)"
)
ORDER = 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ", "xformOp:scale"]'


def nested(kinds: str) -> str:
    """DEPTH levels, the last one a block: n for a native instance, p for a point instancer; two instances every fifth level."""
    text = f'class Xform "_level0"\n{{\n    {block(np.eye(3) * 0.3)}\n}}\n'
    for k in range(1, DEPTH + 1):
        twice, below = k % 5 == 0, f"/_level{k - 1}"
        if kinds[k % len(kinds)] == "n":
            header = f"(\n prepend references = <{below}>\n instanceable = true\n)"
            one = f'def Xform "a" {header}\n{{\n {STEP}\n {ORDER}\n}}\n'
            order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
            two = f'def Xform "b" {header}\n{{\n double3 xformOp:translate = (-0.4, 0.3, 0.1)\n {order}\n}}\n'
            inside = one + (two if twice else "")
        else:
            positions = "[(0.2, 0.1, 0), (-0.4, -0.2, 0.1)]" if twice else "[(0.2, 0.1, 0)]"
            inside = f"""def PointInstancer "many"
            {{
                {STEP}
                {ORDER}
                rel prototypes = </_level{k}/many/proto>
                int[] protoIndices = {"[0, 0]" if twice else "[0]"}
                point3f[] positions = {positions}
                quath[] orientations = {"[(0.9, 0.1, 0.3, 0), (1, 0, 0, 0)]" if twice else "[(0.9, 0.1, 0.3, 0)]"}
                def Xform "proto" (
                    prepend references = <{below}>
                )
                {{
                }}
            }}
            """
        text += f'class Xform "_level{k}"\n{{\n{inside}\n}}\n'
    return text + f'def Xform "top" (\n prepend references = </_level{DEPTH}>\n)\n{{\n}}\n'


@pytest.mark.hard_case(
    "Instances",
    "nested to depth 20: %s",
    expected="the picture of the same expanded into plain prims, 16 of them",
)
@pytest.mark.parametrize("kinds", ["n", "p", "np"], ids=["native instances", "point instancers", "both in turn"])
def test_nested(kinds: str, measured) -> None:
    stage = stage_of(nested(kinds))
    flat = flat_stage(stage, Usd.TimeCode.Default())
    assert len(flat.GetPseudoRoot().GetChildren()) == 16
    around = stage_of(WALL + LIGHTS + CAMERA)
    pictures = []
    for made, seed in ((stage, 0), (flat, 0), (flat, 1)):
        made.GetRootLayer().subLayerPaths.append(around.GetRootLayer().identifier)
        pictures.append(picture_of(made, seed=seed, spp=3))  # without a pilot, which a last bit may decide
        made.GetRootLayer().subLayerPaths.clear()
    image, expected, again = pictures
    assert problems(image) == []
    assert image.report["scene"]["instances"] == 16
    found = apart(image, expected, again)
    assert found < 0.02  # a sample or two at an edge
    measured(f"{bound(found)} of the picture's variance")


@pytest.mark.hard_case(
    "Numbers",
    "half quaternions (orientations), 20,000 at random",
    expected="rotations: axes of length 1 as for orientationsf of the same values",
    plain_float="axes as long as the quaternion's square says: up to 0.1 % off",
)
def test_half_quaternions(measured) -> None:
    q = np.random.default_rng(0).normal(size=(20_000, 4))
    half = (q / np.linalg.norm(q, axis=1)[:, None]).astype(np.float16)
    worst = float(np.abs((half.astype(np.float64) ** 2).sum(axis=1) - 1).max())
    assert worst > 1e-4
    level, same = (
        PointInstances(np.eye(4)[:3], np.zeros((len(q), 3)), values).rows(0, len(q))
        for values in (half, half.astype(np.float32))
    )
    np.testing.assert_array_equal(level, same)
    gram = level[:, :, :3].transpose(0, 2, 1) @ level[:, :, :3]
    off = float(np.abs(gram - np.eye(3)).max())
    assert off < 2e-15
    # Through a stage: the attribute in half, and the same numbers in float.
    pictures = []
    for name, kind in (("orientations", Gf.Quath), ("orientationsf", Gf.Quatf)):
        stage = crowd(np.array([[-1.2, 0, 0], [1.2, 0.4, 0]]), np.full((2, 3), 0.7))
        attribute = UsdGeom.PointInstancer(stage.GetPrimAtPath("/crowd"))
        make = attribute.CreateOrientationsAttr if name == "orientations" else attribute.CreateOrientationsfAttr
        array = (Vt.QuathArray if kind is Gf.Quath else Vt.QuatfArray)([kind(*map(float, row)) for row in half[:2]])
        make(array)
        pictures.append(picture_of(stage).pixels)
    np.testing.assert_array_equal(pictures[0], pictures[1])
    measured(
        f"axes perpendicular and of length 1 to 1e-15; the same picture bit for bit (the halves' lengths are {worst:.0e} off)"
    )
