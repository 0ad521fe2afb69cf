"""Tubes that move, stand in instances, far away, or wear what varies along them."""

from __future__ import annotations

import numpy as np
import pytest

from .test_tubes import AOVS, CYLINDERS, FLAT
from .views import centres, cubic, curves, linear, look, values

BODY = CYLINDERS["bezier"]


def assert_a_cylinder(text: str, radius: float = 0.4, half: float = 1.5) -> None:
    image = look(text, *AOVS)
    x, y = centres()
    inside = (np.abs(x) < half) & (np.abs(y) < radius)
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
    z = np.sqrt(radius**2 - y[inside] ** 2)
    assert np.abs(values(image, "position")[inside][:, 2] - z).max() < 2e-5


PLACED = {
    "native instance": 'class "p"\n{\n'
    + curves(BODY)
    + '}\ndef "i" (\n instanceable = true\n inherits = </p>\n)\n{\n}\n'
    + 'def "j" (\n instanceable = true\n inherits = </p>\n)\n{\n'
    + 'double3 xformOp:translate = (0, 50, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]\n}\n',
    "point instancer": 'def PointInstancer "i"\n{\nrel prototypes = </i/p>\nint[] protoIndices = [0, 0]\n'
    + 'point3f[] positions = [(0, 0, 0), (0, 50, 0)]\ndef Xform "p"\n{\n'
    + curves(BODY)
    + "}\n}\n",
}


@pytest.mark.parametrize("how", PLACED)
def test_instances(how: str) -> None:
    assert_a_cylinder(PLACED[how])


def test_an_elliptic_tube_in_instances() -> None:
    """Stretched inside the prototype: its own prototype stands wherever that one does."""
    inner = curves(BODY, transform='float3 xformOp:scale = (1, 2, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]')
    image = look(PLACED["point instancer"].replace(curves(BODY), inner), "distance")
    x, y = centres()
    assert np.array_equal(np.isfinite(values(image, "distance")), (np.abs(x) < 1.5) & (np.abs(y) < 0.8))


def test_far_from_the_origin() -> None:
    """Hair 1e8 from the origin, as the camera is: nothing is lost, as its points are near its prim."""
    transform = 'double3 xformOp:translate = (100000000, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    image = look(curves(BODY, transform=transform), "distance", "geometric_normal", far="100000000")
    x, y = centres()
    inside = (np.abs(x) < 1.5) & (np.abs(y) < 0.4)
    assert np.array_equal(np.isfinite(values(image, "distance")), inside)
    n = values(image, "geometric_normal")[inside]
    assert np.abs(n[:, 1] - y[inside] / 0.4).max() < 1e-4


OPEN = "double shutter:open = 0\n    double shutter:close = 1"
MOVING = """point3f[] points.timeSamples = {{
    0: [(-1.5, {a}, 0), (-0.3, {a}, 0), (0.1, {a}, 0), (1.5, {a}, 0)],
    1: [(-1.5, {b}, 0), (-0.3, {b}, 0), (0.1, {b}, 0), (1.5, {b}, 0)],
}}"""


@pytest.mark.parametrize("how", ["samples", "velocities", "transform"])
def test_tubes_that_move_are_blurred(how: str) -> None:
    """By 1 unit over the frame: alpha is the share of the time that a place is covered."""
    if how == "samples":
        body = BODY.replace(BODY[BODY.index("point3f[]") : BODY.index("float[] widths")], MOVING.format(a=-0.5, b=0.5) + "\n")
        text = curves(body)
    elif how == "velocities":
        points = BODY[BODY.index("[(-1.5") : BODY.index("]\nfloat[] widths") + 1]
        rates = ", ".join(["(0, 24, 0)"] * 4)
        timed = f"point3f[] points.timeSamples = {{ 0: {points} }}\nvector3f[] velocities.timeSamples = {{ 0: [{rates}] }}\n"
        timed = timed.replace(", 0, 0)", ", -0.5, 0)")
        text = curves(BODY.replace(f"point3f[] points = {points}", timed))
    else:
        move = "double3 xformOp:translate.timeSamples = { 0: (0, -0.5, 0), 1: (0, 0.5, 0) }"
        text = curves(BODY, transform=f'{move}\nuniform token[] xformOpOrder = ["xformOp:translate"]')
    image = look(text, time_code=0, size=32, spp=128, camera=OPEN)
    x, y = centres(32)
    share = np.clip(np.minimum(y + 0.4, 0.5) - np.maximum(y - 0.4, -0.5), 0, 1)
    alpha = image.pixels[..., 3]
    inside = np.abs(x) < 1.45
    assert np.abs(alpha - share)[inside].max() < 0.2
    assert abs(float((alpha - share)[inside].mean())) < 0.01
    assert (alpha[np.abs(x) > 1.55] == 0).all()


def test_widths_that_change_are_blurred() -> None:
    body = BODY.replace("float[] widths = [0.8] (", "float[] widths.timeSamples = { 0: [0], 1: [1.6] }\nfloat[] widths (")
    text = curves(body)
    image = look(text, time_code=0, size=32, spp=128, camera=OPEN)
    x, y = centres(32)
    share = np.clip(1 - np.abs(y) / 0.8, 0, 1)
    inside = np.abs(x) < 1.45
    assert np.abs(image.pixels[..., 3] - share)[inside].mean() < 0.03


def test_colours_go_along_the_curve() -> None:
    """Albedo of a colour at both ends, linear between; of one at control points, a cubic."""
    ends = "color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)] (\n interpolation = 'varying'\n)"
    image = look(curves(cubic("[(-1.5, 0, 0), (-0.5, 0, 0), (0.5, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8), more=ends)), "albedo")
    x, y = centres()
    inside = (np.abs(x) < 1.45) & (np.abs(y) < 0.35)
    s = (x[inside] + 1.5) / 3
    assert np.abs(values(image, "albedo")[inside] - np.stack([1 - s, 0 * s, s], axis=1)).max() < 0.03


@pytest.mark.parametrize("place", ["alone", "instanced"])
def test_tubes_have_holes_where_their_opacity_is_below_the_threshold(place: str) -> None:
    """From x = 0 on: the discs at the far ends are gone as well."""
    material = """def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:opacityThreshold = 0.5
        float inputs:opacity.connect = </m/r.outputs:result>
        token outputs:surface
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "alpha"
        float outputs:result
    }
}
"""
    alpha = "float[] primvars:alpha = [1, 0] (\n interpolation = 'varying'\n)\nrel material:binding = </m>"
    text = curves(cubic("[(-1.5, 0, 0), (-0.5, 0, 0), (0.5, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8), more=alpha))
    text = text.replace('"c"', '"c" (prepend apiSchemas = ["MaterialBindingAPI"])')
    if place == "instanced":
        text = PLACED["point instancer"].replace(curves(BODY), text)
    image = look(text + material, spp=16)
    x, y = centres()
    inside = (np.abs(x) < 1.5) & (np.abs(y) < 0.4)
    assert (image.pixels[..., 3][inside & (x < -0.05)] == 1).all()
    assert (image.pixels[..., 3][(x > 0.05)] == 0).all()


def test_subsets_colour_segments() -> None:
    material = """def Material "red"
{
    token outputs:surface.connect = </red/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (1, 0, 0)
        token outputs:surface
    }
}
"""
    subset = """def GeomSubset "s" (prepend apiSchemas = ["MaterialBindingAPI"])
{
uniform token elementType = "segment"
uniform token familyName = "materialBind"
int[] indices = [0, 1]
rel material:binding = </red>
}"""
    grey = "color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]"
    body = linear("[(-1.5, 0, 0), (0, 0, 0), (1.5, 0, 0)]", FLAT.format(0.8), grey)
    image = look(curves(body + "\n" + subset) + material, "albedo")
    x, y = centres()
    albedo = values(image, "albedo")
    assert np.abs(albedo[(x > -1.4) & (x < -0.1) & (np.abs(y) < 0.35)] - 0.5).max() < 1e-3
    right = albedo[(x > 0.1) & (x < 1.4) & (np.abs(y) < 0.35)]
    assert (right[:, 0] - right[:, 1] > 0.8).all()
