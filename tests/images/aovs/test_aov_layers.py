"""AOVs of what is seen through, of lights, and filtered ones: albedo and emission."""

from __future__ import annotations

import numpy as np
import pytest
from tests.images.aovs.seen import stage_of
from tests.images.aovs.test_aovs import picture, values

from primray.images.image import Image

SQUARE = """
def Mesh "NAME"
{
    point3f[] points = [(-9, -9, Z), (9, -9, Z), (9, 9, Z), (-9, 9, Z)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [COLOR]
MORE
}
"""
NO_LIGHT = 'def DistantLight "sun"\n{\n}\n'  # which the camera does not see


def square(name: str, z: float, color: tuple[float, float, float] = (0.5, 0.5, 0.5), more: str = "") -> str:
    return SQUARE.replace("NAME", name).replace("Z", str(z)).replace("COLOR", str(color)).replace("MORE", more)


def opacity(value: float) -> str:
    return f"    float[] primvars:displayOpacity = [{value}]\n"


MATERIAL = """
def Material "NAME"
{
    token outputs:surface.connect = </NAME/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
        INPUTS
    }
    def Shader "read"
    {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "there"
        float outputs:result
    }
}
"""


def material(name: str, **inputs: object) -> str:
    kinds = {tuple: "color3f", int: "int"}
    lines = [f"{kinds.get(type(v), 'float')} inputs:{n} = {v}" for n, v in inputs.items() if v != "read"]
    lines += [f"float inputs:{n}.connect = </{name}/read.outputs:result>" for n, v in inputs.items() if v == "read"]
    return MATERIAL.replace("NAME", name).replace("INPUTS", "\n        ".join(lines))


def wears(name: str) -> str:
    return f"    rel material:binding = </{name}>\n"


def worn(text: str) -> str:
    """With the schema that makes bindings count."""
    return text.replace("\n{\n    point3f", ' (\n    prepend apiSchemas = ["MaterialBindingAPI"]\n)\n{\n    point3f')


def of(image: Image, name: str) -> np.ndarray:
    """The one value that all pixels have."""
    found = image.aovs[name].values
    assert (found == found[0, 0]).all()
    return found[0, 0]


@pytest.mark.parametrize(("there", "depth"), [(0.25, 8.0), (0.75, 6.0), (0.5, 6.0)])
def test_what_is_there_by_half_is_seen_and_colours_mix(there: float, depth: float) -> None:
    """At z 0 and -2 from 6: point samples see the one or the other, filtered ones both by their share."""
    front, back = (0.75, 0.5, 0.25), (0.125, 0.25, 0.5)
    text = square("a", 0, front, opacity(there)) + square("b", -2, back)
    image = picture(stage_of(text, light=NO_LIGHT), ("depth", "prim", "albedo", "normal"))
    assert of(image, "depth") == depth
    assert of(image, "prim") == (1 if depth == 6 else 2)
    np.testing.assert_allclose(of(image, "albedo"), there * np.array(front) + (1 - there) * np.array(back), rtol=1e-6)
    np.testing.assert_allclose(image.pixels[..., 3], 1)


def test_many_layers_that_are_hardly_there() -> None:
    layers = "".join(square(f"layer{k}", -0.01 * k, (1, 1, 1), opacity(0.125)) for k in range(20))
    image = picture(stage_of(layers + square("wall", -2, (0, 0, 0)), light=NO_LIGHT), ("depth", "albedo"))
    assert of(image, "depth") == 8
    np.testing.assert_allclose(of(image, "albedo"), 1 - 0.875**20, rtol=1e-5)


def test_holes_of_cutouts_show_what_is_behind() -> None:
    more = wears("holes") + '    float[] primvars:there = [1, 0, 0, 1] (interpolation = "vertex")\n'
    text = worn(square("a", 0, more=more)) + square("b", -2) + material("holes", opacity="read", opacityThreshold=0.5)
    image = picture(stage_of(text, light=NO_LIGHT), ("depth", "position", "prim", "material", "primvar:there"))
    depth, x = values(image, "depth"), values(image, "position")[..., 0]
    assert set(np.unique(depth).tolist()) == {6.0, 8.0}
    assert (x[depth == 6] <= 0).all()
    assert (x[depth == 8] >= 0).all()
    assert np.array_equal(values(image, "prim"), np.where(depth == 6, 1, 2))
    assert np.array_equal(values(image, "material"), np.where(depth == 6, 1, 0))
    np.testing.assert_allclose(values(image, "primvar:there"), np.where(depth == 6, 0.5 - x / 18, 0), atol=1e-6)


def test_mirrors_and_glass_are_surfaces_like_others() -> None:
    glass = material("glass", opacity=0.0, ior=1.5, roughness=0.0)
    text = worn(square("a", 0, more=wears("glass"))) + square("b", -2, (0.5, 0, 0)) + glass
    image = picture(stage_of(text, light=NO_LIGHT), ("depth", "material", "albedo"))
    assert of(image, "depth") == 6
    assert image.aovs["material"].ids == {1: "/glass"}
    np.testing.assert_allclose(of(image, "albedo"), [1, 1, 1], rtol=1e-6)  # what is not reflected passes


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        # F0 = ((1 - ior) / (1 + ior))^2 = 0.04; the rest of the light reaches the diffuse colour.
        ({"diffuseColor": (0.5, 0.25, 0.0)}, [0.04 + 0.96 * 0.5, 0.04 + 0.96 * 0.25, 0.04]),
        ({"diffuseColor": (0.5, 0.25, 0.0), "roughness": 0.1}, [0.04 + 0.96 * 0.5, 0.04 + 0.96 * 0.25, 0.04]),
        ({"diffuseColor": (0.9, 0.6, 0.3), "metallic": 1.0}, [0.9, 0.6, 0.3]),
        ({"diffuseColor": (0.5, 0.5, 0.5), "useSpecularWorkflow": 1, "specularColor": (0.5, 0.25, 0.0)}, [0.75, 0.625, 0.5]),
        ({"diffuseColor": (0.5, 0.5, 0.5), "opacity": 0.5}, [0.04 + 0.96 * 0.75] * 3),
        ({"diffuseColor": (0.5, 0.5, 0.5), "clearcoat": 0.5}, [0.52 * (1 - 0.02) + 0.02] * 3),
        ({"diffuseColor": (1.0, 1.0, 1.0)}, [1.0] * 3),
    ],
)
def test_albedo_is_the_reflectance_at_normal_incidence(inputs: dict[str, object], expected: list[float]) -> None:
    text = worn(square("a", 0, more=wears("m"))) + material("m", **inputs)
    image = picture(stage_of(text, light=NO_LIGHT), ("albedo",))
    np.testing.assert_allclose(of(image, "albedo"), expected, rtol=2e-6)


def test_filtered_values_are_means_over_pixels() -> None:
    """A slanted edge between two colours: as much of each as of the pixel's area, to the 16th that is sampled."""
    text = """
def Mesh "half"
{
    point3f[] points = [(-9, -9, 0), (2, -9, 0), (-2, 9, 0), (-9, 9, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [(1, 1, 1)]
}
"""
    size = (48, 36)
    image = picture(stage_of(text + square("b", -0.001, (0, 0, 0)), light=NO_LIGHT), ("albedo",), size)
    # Exact areas, from 64 x 64 points a pixel: the edge is x = -2 y / 9, pixels are 6/48 wide.
    step = (np.arange(48 * 64) + 0.5) / 64
    x, y = np.meshgrid(-3 + step * 6 / 48, 2.25 - step[: 36 * 64] * 4.5 / 36)
    area = (x < -2 * y / 9).reshape(36, 64, 48, 64).mean(axis=(1, 3))
    found = image.aovs["albedo"].values[..., 0]
    mixed = (area > 0) & (area < 1)
    assert np.array_equal(found[~mixed], area[~mixed])
    assert np.abs(found - area).max() < 0.17  # 16 points, stratified both ways: 1/8 for the edge's length, and 1/32
    assert np.sqrt(np.mean((found - area)[mixed] ** 2)) < 0.05
    assert abs((found - area)[mixed].mean()) < 0.012


LAMP = """
def RectLight "lamp"
{
    float inputs:intensity = 3
    color3f inputs:color = (1, 0.5, 0.25)
    float inputs:width = 20
    float inputs:height = 20
    float3 xformOp:rotateXYZ = (0, 180, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""


def test_a_light_that_the_camera_sees_emits_and_is_background() -> None:
    """Turned around to the camera: a RectLight shines along -Z."""
    stage = stage_of(square("wall", -2), light=LAMP)
    stage.GetPrimAtPath("/cam").GetAttribute("exposure").Set(1.0)
    image = picture(stage, ("emission", "depth", "prim", "albedo", "normal"))
    np.testing.assert_allclose(of(image, "emission"), [6, 3, 1.5], rtol=1e-6)  # an exposure of 1 doubles
    np.testing.assert_allclose(image.pixels[..., :3], image.aovs["emission"].values, rtol=1e-6)
    assert (image.pixels[..., 3] == 1).all()
    assert np.isinf(of(image, "depth"))
    assert of(image, "prim") == 0
    for name in ("albedo", "normal"):
        assert (of(image, name) == 0).all()


def test_emission_is_what_surfaces_and_skies_send_to_the_camera_directly() -> None:
    sky = 'def DomeLight "sky"\n{\n    float inputs:intensity = 0.25\n}\n'
    shines = material("glow", diffuseColor=(0.0, 0.0, 0.0), emissiveColor=(4.0, 2.0, 1.0))
    half = worn(square("a", 0, more=wears("glow"))).replace("(9, ", "(0, ") + shines
    image = picture(stage_of(half, light=sky), ("emission", "prim"))
    there = values(image, "prim") == 1
    np.testing.assert_allclose(values(image, "emission")[there], [[4, 2, 1]] * int(there.sum()), rtol=1e-6)
    np.testing.assert_array_equal(values(image, "emission")[~there], [[0.25] * 3] * int((~there).sum()))
    assert there[:, :35].all()
    assert not there[:, 37:].any()


def test_emission_behind_what_is_there_in_part() -> None:
    glow = material("glow", diffuseColor=(0.0, 0.0, 0.0), emissiveColor=(4.0, 2.0, 1.0))
    text = square("veil", 0, (0, 0, 0), opacity(0.25)) + worn(square("b", -2, more=wears("glow"))) + glow
    image = picture(stage_of(text, light=NO_LIGHT), ("emission",))
    np.testing.assert_allclose(of(image, "emission"), [3, 1.5, 0.75], rtol=1e-6)


def test_a_surface_that_is_there_in_part_emits_by_that_part() -> None:
    glow = material("glow", diffuseColor=(0.0, 0.0, 0.0), emissiveColor=(4.0, 2.0, 1.0), opacity=0.25, ior=1.0)
    glow = glow.replace("token outputs:surface\n", 'token outputs:surface\n        token inputs:opacityMode = "presence"\n')
    text = worn(square("a", 0, more=wears("glow"))) + square("b", -2) + glow
    image = picture(stage_of(text, light=NO_LIGHT), ("emission", "depth"))
    np.testing.assert_allclose(of(image, "emission"), [1, 0.5, 0.25], rtol=1e-6)
    assert of(image, "depth") == 8


def test_albedo_of_colours_that_vary() -> None:
    varying = '    color3f[] primvars:displayColor = [(0, 0, 1), (1, 0, 1), (1, 0, 1), (0, 0, 1)] (interpolation = "vertex")\n'
    text = square("a", 0).replace("    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]\n", varying)
    image = picture(stage_of(text, light=NO_LIGHT), ("albedo", "position"))
    red = 0.5 + values(image, "position")[..., 0] / 18
    np.testing.assert_allclose(image.aovs["albedo"].values, np.stack([red, 0 * red, 0 * red + 1], axis=2), atol=6 / 72 / 18 / 4)


def test_presence_that_varies_decides_where_points_look_through() -> None:
    """Of a square whose opacity goes from 0 at the left to 1 at the right, the right half is there."""
    opacities = '    float[] primvars:displayOpacity = [0, 1, 1, 0] (interpolation = "vertex")\n'
    label = "    token[] semantics:labels:class = ['NAME']\n".replace("'", '"')
    front = square("front", 1, more=opacities + label.replace("NAME", "front"))
    back = square("back", 0, more=label.replace("NAME", "back"))
    image = picture(stage_of(NO_LIGHT + front + back), aovs=("depth", "prim", "object_instance:class"))
    middle = image.pixels.shape[1] // 2
    of_prims = image.aovs["prim"].ids
    shown = np.vectorize(of_prims.get)(values(image, "prim"))
    assert set(shown[:, :middle].ravel()) == {"/back"}
    assert set(shown[:, middle + 1 :].ravel()) == {"/front"}
    things = {thing.path: thing for thing in image.things}
    assert np.array_equal(image.mask_of(things["/front"]), shown == "/front")
    half = things["/back"].pixels_in_frame // 2
    assert abs(things["/front"].pixels_in_frame - half) <= shown.shape[0]
    assert things["/back"].pixels_visible == (shown == "/back").sum()
