"""Whole scenes from 1e-6 to 1e6 of their size, and things of all these sizes in one scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from tests.hard.places.placed_scenes import CUBE, apart, bound, problems, shot

from primray.images.image import Image

SCALES = (1e-6, 1e-3, 1e3, 1e6)
CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
FACES = CUBE[: CUBE.index("    point3f[]")]
QUAD = """int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    """


def op(v: tuple[float, ...], turn: tuple[float, ...] = (0, 0, 0), kind: str = "double3") -> str:
    return f"""{kind} xformOp:translate = {v!r}
    float3 xformOp:rotateXYZ = {turn!r}
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]"""


def times(s: float, *v: float) -> tuple[float, ...]:
    return tuple(s * x for x in v)


def points(s: float, corners: Sequence[tuple[float, ...]]) -> str:
    return "point3f[] points = [" + ", ".join(repr(times(s, *c)) for c in corners) + "]"


def things(s: float) -> str:
    """A ground, a block, a ball, small instances, and lights whose picture does not depend on the scale."""
    return f"""def Mesh "ground"
{{
    {QUAD}
    {points(s, [(-5, 0, 5), (5, 0, 5), (5, 0, -5), (-5, 0, -5)])}
}}
def Mesh "block"
{{
    {op(times(s, -1.4, 0.8, 0), (10, 35, 5))}
    color3f[] primvars:displayColor = [(0.8, 0.3, 0.2)]
    {FACES}
    {points(0.6 * s, CORNERS)}
}}
def Sphere "ball"
{{
    double radius = {0.7 * s!r}
    {op(times(s, 1.2, 0.8, 0.4))}
}}
def PointInstancer "crumbs"
{{
    rel prototypes = <crumb>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [{times(s, -0.2, 0.3, 1.6)}, {times(s, 0.5, 0.25, 1.9)}, {times(s, 2.2, 0.3, 1.2)}]
    quath[] orientations = [(1, 0, 0, 0), (0.9, 0.1, 0.3, 0), (0.5, 0.5, 0.2, 0.6)]
    def Mesh "crumb"
    {{
        {FACES}
        {points(0.25 * s, CORNERS)}
    }}
}}
def RectLight "lamp"
{{
    float inputs:width = {2 * s!r}
    float inputs:height = {s!r}
    float inputs:intensity = 20
    {op(times(s, -2, 5, 3), (-60, -20, 0))}
}}
def SphereLight "bulb"
{{
    float inputs:radius = {0.2 * s!r}
    float inputs:intensity = 30
    {op(times(s, 2.5, 2, 1))}
}}
def CylinderLight "tube"
{{
    float inputs:radius = {0.05 * s!r}
    float inputs:length = {1.5 * s!r}
    float inputs:intensity = 20
    {op(times(s, -2.5, 2, 2), (0, 20, 30))}
}}
def DistantLight "sun"
{{
    float inputs:angle = 1
    float inputs:intensity = 1000
    {op((0, 0, 0), (-40, 30, 0))}
}}
def DomeLight "sky"
{{
    float inputs:intensity = 0.2
}}
"""


def camera(s: float, orthographic: bool) -> str:
    """Orthographic apertures are tenths of scene units (UsdGeomCamera)."""
    kind = "orthographic" if orthographic else "perspective"
    width = 45 * s if orthographic else 20.0
    return f"""def Camera "eye"
{{
    {op(times(s, 0.3, 1.7, 10), (-8, 0, 0))}
    token projection = "{kind}"
    float horizontalAperture = {width!r}
    float verticalAperture = {0.75 * width!r}
    float2 clippingRange = {times(s, 0.1, 1000)!r}
}}
"""


def authored(s: float) -> str:
    return 'def Xform "world"\n{\n' + things(s) + "}\n"


def by_the_root(s: float) -> str:
    """Size 1 under a scale in double."""
    scale = f'double3 xformOp:scale = {(s, s, s)!r}\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
    return 'def Xform "world"\n{\n' + scale + things(1.0) + "}\n"


@pytest.mark.hard_case(
    "Scales",
    "a whole scene times 1e-6, 1e-3, 1e3 and 1e6: %s",
    expected="the picture at 1 within its Monte Carlo error: at most 1 in units of its variance",
    plain_float="absolute offsets of 1e-4, as many renderers have, are larger than this scene at 1e-6",
)
@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("way", [authored, by_the_root], ids=["authored sizes", "a scale at the root"])
def test_whole_scene(way, orthographic: bool, measured) -> None:
    def picture(s: float, seed: int = 0) -> Image:
        image = shot(way(s) + camera(s, orthographic), seed=seed)
        assert problems(image) == []
        return image

    expected, again = picture(1.0), picture(1.0, 1)
    assert expected.pixels[..., :3].mean() > 0.1
    found = [apart(picture(s), expected, again) for s in SCALES]
    assert max(found) < 0.05  # float sizes are rounded, so single samples differ
    measured(f"{bound(max(found))} of the variance (the same random numbers)")


SIZES = 10.0 ** np.arange(-6, 7)
SUN = """def DistantLight "sun"
{
    float inputs:angle = 0
    float inputs:intensity = 3
    float3 xformOp:rotateXYZ = %s
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""
AT_ORIGIN = """def Camera "eye"
{
    float horizontalAperture = 20
    float verticalAperture = 20
    float focalLength = 50
    float2 clippingRange = (1e-7, 1e9)
}
"""


def triangles(sizes: np.ndarray) -> str:
    """A triangle of each size in a place of its own on the picture, at a distance that makes all look alike."""
    text = ""
    for k, s in enumerate(sizes.tolist()):
        x, y = 0.4 * (k % 4 - 1.5), 0.4 * (k // 4 - 1.5)
        corners = [(x - 0.15, y - 0.12, -4), (x + 0.15, y - 0.1, -4.1), (x + 0.02, y + 0.14, -3.9)]
        text += f"""def Mesh "triangle{k}"
{{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
    {points(s, corners)}
}}
"""
    return text


@pytest.mark.hard_case(
    "Scales",
    "triangles of 1e-6, 1e-5, ... 1e6 units in one scene, seen alike",
    expected="13 equal pictures: coverage and shading as when all have size 1",
    plain_float="edges of 1e-12 of the scene: the square of a cross product (1e-48) is 0, and the normal NaN",
)
def test_all_sizes_at_once(measured) -> None:
    # The sun shines along the view: no triangle is in another's shadow.
    alike, image = (
        shot(triangles(sizes) + SUN % "(0, 0, 0)" + AT_ORIGIN, resolution=(64, 64), max_depth=1)
        for sizes in (np.ones(13), SIZES)
    )
    assert problems(image) == []
    assert image.report["invalid_samples"] == 0
    assert alike.pixels[..., 3].mean() > 0.02 * 3
    off = np.abs(image.pixels - alike.pixels)
    assert np.count_nonzero(off[..., 3]) <= 13  # a sample or so at an edge: corners are rounded to float
    assert off[..., 3].max() <= 1 / 16 + 1e-6
    same = off[..., 3] == 0
    np.testing.assert_allclose(image.pixels[same], alike.pixels[same], rtol=1e-5)
    measured("shading to 1e-5, coverage but for single samples at edges")


@pytest.mark.hard_case(
    "Scales",
    "an instance with triangles of 1e-6 units in a thing of 1e-3, beside a triangle of 1e6",
    expected="seen and shaded as when it is not instanced and all have size 1",
    plain_float="the cofactors of its matrix times the triangle's normal are 1e-28, and their square 0",
)
@pytest.mark.parametrize("mirror", [1.0, -1.0], ids=["", "mirrored"])
def test_small_in_an_instance(mirror: float, measured) -> None:
    sizes = np.array([1e-6, 1e-3])
    text = f'class Xform "_toy"\n{{\n{triangles(sizes)}}}\n'
    for name, x in (("one", 0.0), ("other", 9.0)):
        text += f"""def Xform "{name}" (
    prepend references = </_toy>
    instanceable = true
)
{{
    double3 xformOp:translate = ({x}, 0, 0)
    float3 xformOp:scale = ({mirror}, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
}}
"""
    far = triangles(np.array([1e6])).replace("triangle0", "far").replace("(-", "(2")
    image = shot(text + far + SUN % "(0, 0, 0)" + AT_ORIGIN, resolution=(64, 64), max_depth=1)
    alike = shot(triangles(np.ones(2)) + SUN % "(0, 0, 0)" + AT_ORIGIN, resolution=(64, 64), max_depth=1)
    assert problems(image) == []
    assert image.report["scene"]["instances"] == 2
    expected = alike.pixels if mirror > 0 else alike.pixels[:, ::-1]
    for columns in (slice(0, 16), slice(16, 32)) if mirror > 0 else (slice(48, 64), slice(32, 48)):
        found, wanted = (p[48:, columns].mean(axis=(0, 1)) for p in (image.pixels, expected))
        assert wanted[3] > 0.1
        np.testing.assert_allclose(found, wanted, rtol=0.02)
    measured("to the noise of 16 samples")


def on_the_ground(ground: float, size: float, tilt_deg: float) -> str:
    """A block of `size` that stands on a square of `ground`, lit from aside and seen from above; all tilted about x."""
    tilted = f"""double xformOp:rotateX = {tilt_deg}
    uniform token[] xformOpOrder = ["xformOp:rotateX"]"""
    return f"""def Xform "world"
{{
    {tilted}
    def Mesh "ground"
    {{
        {QUAD}
        {points(ground, [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)])}
    }}
    def Mesh "block"
    {{
        {FACES}
        {points(size, [(x, y + 1, z) for x, y, z in CORNERS])}
    }}
    {SUN % "(-50, 35, 0)"}
    def Camera "eye"
    {{
        {op(times(size, 0, 20, 8), (-68, 0, 0))}
        float horizontalAperture = 20
        float verticalAperture = 15
        float focalLength = 50
        float2 clippingRange = {times(size, 0.1, 1e9)!r}
    }}
}}
"""


def shadow_pixels(image: Image) -> int:
    return int(np.count_nonzero(image.pixels[..., 0] < 0.02))


@pytest.mark.hard_case(
    "Scales",
    "the shadow of a block of %s units on a square of two triangles, which lies along the axes",
    expected="shadow and light as on a ground just as large as the picture",
    plain_float="an offset of 16 ulps of the triangle's size (1 unit at 1e6) passes over the block",
)
@pytest.mark.parametrize("sizes", [(1e-6, 1e6), (1e-3, 1e6), (1.0, 1e6), (1e3, 1e6)], ids=lambda s: f"{s[0]:g} in {s[1]:g}")
def test_contact_shadow(sizes: tuple[float, float], measured) -> None:
    size, ground = sizes
    expected, image = (shot(on_the_ground(g, size, 0), spp=4, max_depth=1) for g in (20 * size, ground))
    assert problems(image) == []
    assert shadow_pixels(expected) > 100
    different = int(np.count_nonzero(np.abs(image.pixels - expected.pixels).max(axis=2) > 0.3))
    assert different == 0
    np.testing.assert_allclose(image.pixels.mean(), expected.pixels.mean(), rtol=2e-3)
    measured(f"no pixel of {expected.pixels[..., 0].size} differs")


@pytest.mark.hard_case(
    "Scales",
    "the same on a tilted square: a block of %s units",
    expected="shadow and light as on a ground just as large as the picture",
    plain_float="the corners of the square themselves are rounded by 0.06 units at 1e6",
)
@pytest.mark.parametrize("sizes", [(100.0, 1e6), (1e3, 1e6)], ids=lambda s: f"{s[0]:g} in {s[1]:g}")
def test_contact_shadow_tilted(sizes: tuple[float, float], measured) -> None:
    """Smaller things than 1e-4 of such a triangle lose their shadows: its plane is rounded more than they are high."""
    size, ground = sizes
    expected, image = (shot(on_the_ground(g, size, 30), spp=4, max_depth=1) for g in (20 * size, ground))
    different = int(np.count_nonzero(np.abs(image.pixels - expected.pixels).max(axis=2) > 0.3))
    assert different <= 3
    measured(f"at most 3 of {expected.pixels[..., 0].size} pixels differ; things below 1e-4 of the triangle lose their shadow")


@pytest.mark.hard_case(
    "Scales",
    "a block of %s units on a sphere of 1e6",
    expected="shadow and light as on a flat ground",
    plain_float="points of the sphere are rounded by 0.06 units: acne, and shadows from elsewhere",
)
@pytest.mark.parametrize("size", [1e-2, 1.0, 10.0])
def test_planet(size: float, measured) -> None:
    flat = on_the_ground(20 * size, size, 0)
    start, end = flat.index('    def Mesh "ground"'), flat.index('    def Mesh "block"')
    planet = 'def Sphere "planet"\n{\ndouble radius = 1e6\n' + op((0, -1e6, 0)) + "\n}\n"
    expected, image = (shot(text, spp=4, max_depth=1) for text in (flat, flat[:start] + planet + flat[end:]))
    assert problems(image) == []
    different = int(np.count_nonzero(np.abs(image.pixels - expected.pixels).max(axis=2) > 0.3))
    assert different <= 3
    measured(f"{different} of {expected.pixels[..., 0].size} pixels differ")


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1.0])
def test_lost_on_a_tilted_ground(size: float) -> None:
    """What floats cannot tell apart is not right, but neither NaN nor black."""
    image = shot(on_the_ground(1e6, size, 30), spp=4, max_depth=2)
    assert image.report["invalid_samples"] == 0
    assert np.isfinite(image.pixels).all()
