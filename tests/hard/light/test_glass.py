"""Light seen through and in glass, mirrors, cut-outs and stacks of them, by closed forms.

What is modelled of dielectrics: every closed surface is an interface between its own index of refraction and 1, whatever it
stands in; a glass ball inside another loses no light, but bends it as if there were air between both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from tests.statistics.surfaces.preview_surface import PreviewSurface

from primray.description import Surface

from .lit_stages import bound, camera_at, dome, light, material, placed, plates, prim, show, sphere, write_image

Measured = Callable[[str], None]

GLASS = ("float inputs:opacity = 0", "float inputs:roughness = 0")


def glass(name: str, ior: float = 1.5) -> str:
    return material(name, *GLASS, f"float inputs:ior = {ior!r}")


def ball(name: str, of: str, radius: float, x: float = 0.0) -> str:
    return sphere(of, radius, name, placed(x))


NESTS: dict[str, tuple[str, ...]] = {
    "one in another": (ball("a", "water", 1.0), ball("b", "glass", 0.5)),
    "the same surface twice": (ball("a", "water", 1.0), ball("b", "glass", 1.0)),
    "overlapping": (ball("a", "water", 0.7, -0.4), ball("b", "glass", 0.7, 0.4)),
    "ten, one in another": tuple(ball(f"b{k}", ("water", "glass")[k % 2], 1 - 0.04 * k) for k in range(10)),
    "ior 1": (ball("a", "air", 1.0),),
    "ior 0.5": (ball("a", "thin", 1.0),),
    "ior 5": (ball("a", "dense", 1.0),),
    "ior 0": (ball("a", "none", 1.0),),
    "ior 1e6": (ball("a", "huge", 1.0),),
    "the camera in one": (ball("a", "glass", 5.0),),
}
IORS = {"water": 1.33, "glass": 1.5, "air": 1.0, "thin": 0.5, "dense": 5.0, "none": 0.0, "huge": 1e6}
MATERIALS = tuple(glass(name, ior) for name, ior in IORS.items())


@pytest.mark.parametrize("nest", NESTS)
@pytest.mark.hard_case("Materials", "lossless glass under a sky of 1: %s", expected="1, to 1e-5: it cannot be seen")
def test_furnace(nest: str, measured: Measured) -> None:
    found = show(camera_at(4.0), dome(), *NESTS[nest], *MATERIALS, spp=64)
    np.testing.assert_allclose(found.pixels, 1, atol=1e-5)
    assert found.invalid_samples == 0
    measured("1")


@pytest.mark.hard_case(
    "Materials", "twenty glass balls in each other, no limit of depth", expected="ends, never above 1",
    plain_float="paths that total reflection keeps never end",
)  # fmt: skip
def test_caught_paths_end(measured: Measured) -> None:
    nest = [ball(f"b{k}", ("water", "glass")[k % 2], 1 - 0.04 * k) for k in range(20)]
    found = show(camera_at(4.0), dome(), *nest, *MATERIALS, spp=16)
    assert found.image.report["rays"] / found.image.report["samples"] < 4000
    assert found.pixels.max() < 1 + 5e-5
    measured(f"ends, {found.mean:.1f}")


FLAT = 'uniform token subdivisionScheme = "none"'


def slab(thickness: float, angle_deg: float, of: str) -> str:
    """A closed box, wide, turned about x."""
    ops = 'uniform token[] xformOpOrder = ["xformOp:rotateX", "xformOp:scale"]'
    turned = f"double xformOp:rotateX = {angle_deg!r}\ndouble3 xformOp:scale = (20, 20, {thickness!r})\n{ops}"
    return prim("Cube", "slab", "double size = 1", bound(of), turned, apis=["MaterialBindingAPI"])


BEHIND = light(
    "RectLight", "float inputs:width = 4", "float inputs:height = 4", at=placed(z=-10.0, rotate_x=180.0)
)  # too small to be mirrored as well


def orthographic(width: float, z: float = 10.0) -> str:
    return prim(
        "Camera", "camera", "float2 clippingRange = (0.0001, 1000)", 'token projection = "orthographic"',
        f"float horizontalAperture = {10 * width!r}", f"float verticalAperture = {10 * width!r}", placed(z=z),
    )  # fmt: skip


ORTHOGRAPHIC = orthographic(0.2)


def schlick(ior: float, angle_deg: float) -> float:
    f0 = ((1 - ior) / (1 + ior)) ** 2
    return f0 + (1 - f0) * (1 - math.cos(math.radians(angle_deg))) ** 5


@pytest.mark.parametrize("angle", [0.0, 45.0, 70.0])
@pytest.mark.hard_case("Lights", "seen through a slab of glass, ior 1.5, at %s degrees", expected="(1 - F) / (1 + F)")
def test_slab(angle: float, measured: Measured) -> None:
    """Both faces, with what goes to and fro between them."""
    found = show(ORTHOGRAPHIC, BEHIND, slab(0.1, angle, "glass"), *MATERIALS, spp=1024)
    f = schlick(1.5, angle)
    wanted = (1 - f) / (1 + f)
    assert abs(found.mean - wanted) < 5 * found.noise + 2e-4
    measured(f"{found.mean / wanted:.3f} of it")


@pytest.mark.parametrize("angle", [0.0, 45.0, 70.0])
@pytest.mark.hard_case("Lights", "seen through a thin pane, ior 1.5, at %s degrees", expected="1 - F: one surface")
def test_pane(angle: float, measured: Measured) -> None:
    c, s = 5 * math.cos(math.radians(angle)), 5 * math.sin(math.radians(angle))
    pane = prim(
        "Mesh", "pane", "int[] faceVertexCounts = [4]", "int[] faceVertexIndices = [0, 1, 2, 3]", FLAT, bound("glass"),
        f"point3f[] points = [(-5, {-c!r}, {-s!r}), (5, {-c!r}, {-s!r}), (5, {c!r}, {s!r}), (-5, {c!r}, {s!r})]",
        apis=["MaterialBindingAPI"],
    )  # fmt: skip
    found = show(ORTHOGRAPHIC, BEHIND, pane, *MATERIALS, spp=1024)
    wanted = 1 - schlick(1.5, angle)
    assert abs(found.mean - wanted) < 5 * found.noise + 2e-4
    measured(f"{found.mean / wanted:.3f} of it")


# A plate at 45 degrees that shows what is above.
MIRROR = (
    "Mesh", "mirror", "int[] faceVertexCounts = [4]", "int[] faceVertexIndices = [0, 1, 2, 3]", FLAT,
    "point3f[] points = [(-5, -5, 5), (5, -5, 5), (5, 5, -5), (-5, 5, -5)]",
)  # fmt: skip
METAL = ("color3f inputs:diffuseColor = (1, 1, 1)", "float inputs:metallic = 1")


def mirror(*inputs: str) -> str:
    return prim(*MIRROR, bound("m"), apis=["MaterialBindingAPI"]) + material("m", *inputs)


@pytest.mark.hard_case("Lights", "seen in a mirror", expected="its radiance, exactly")
def test_in_a_mirror(measured: Measured) -> None:
    overhead = light("RectLight", "float inputs:width = 30", "float inputs:height = 30", at=placed(y=9.0, rotate_x=-90.0))
    found = show(ORTHOGRAPHIC, overhead, mirror(*METAL, "float inputs:roughness = 0"), spp=16)
    np.testing.assert_allclose(found.pixels, 1, rtol=1e-6)
    measured("1")


@pytest.mark.parametrize("roughness", ["0", "1e-4", "1e-3", "0.02"])
@pytest.mark.hard_case(
    "Materials", "a small light's image in metal of roughness %s", expected="its energy, to 1 %; no pixel brighter than it",
    plain_float="alpha^4 in D is 0 below a roughness of 1e-5: 0 / 0",
)  # fmt: skip
def test_image_of_a_light(roughness: str, measured: Measured) -> None:
    lamp = light("SphereLight", "float inputs:radius = 0.3", at=placed(y=4.0))
    found = show(orthographic(1.0), lamp, mirror(*METAL, f"float inputs:roughness = {roughness}"), resolution=(32, 32), spp=256)
    wanted = math.pi * 0.3**2  # of the picture's one square unit
    assert found.mean == pytest.approx(wanted, rel=1e-2)
    assert found.pixels.max() < 1.05
    assert (found.gray[:3] < 1e-2).all()
    measured(f"{found.mean / wanted:.2f} of it")


@pytest.mark.hard_case("Lights", "seen through the holes of a cut-out", expected="its radiance or nothing, exactly")
def test_through_a_cutout(tmp_path: Path, measured: Measured) -> None:
    """Left half open, right half shut."""
    texture = write_image(tmp_path / "holes.exr", np.array([[[0.0], [1.0]]]))
    reader = prim(
        "Shader",
        "st",
        'uniform token info:id = "UsdPrimvarReader_float2"',
        'string inputs:varname = "st"',
        "float2 outputs:result",
    )
    image = prim(
        "Shader", "image", 'uniform token info:id = "UsdUVTexture"', f"asset inputs:file = {texture}",
        'token inputs:sourceColorSpace = "raw"', "float2 inputs:st.connect = </m/st.outputs:result>", "float outputs:r",
    )  # fmt: skip
    surface = prim(
        "Shader", "surface", 'uniform token info:id = "UsdPreviewSurface"',
        "float inputs:opacity.connect = </m/image.outputs:r>",
        "float inputs:opacityThreshold = 0.5", "color3f inputs:diffuseColor = (0, 0, 0)", "float inputs:ior = 1",
        "int inputs:useSpecularWorkflow = 1", "token outputs:surface",
    )  # fmt: skip
    cut = prim("Material", "m", "token outputs:surface.connect = </m/surface.outputs:surface>", reader, image, surface)
    st = 'texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")'
    found = show(ORTHOGRAPHIC, BEHIND, plates("m", [0.0], 5.0, st), cut, spp=64)
    np.testing.assert_allclose(found.pixels[:, :3], 1, rtol=1e-6)
    assert found.pixels[:, 5:].max() < 1e-6
    measured("1 and 0")


def presence(opacity: float, color: str = "(0, 0, 0)") -> str:
    return material(
        "m", f"float inputs:opacity = {opacity!r}", 'uniform token inputs:opacityMode = "presence"',
        f"color3f inputs:diffuseColor = {color}", "float inputs:roughness = 1", "int inputs:useSpecularWorkflow = 1",
    )  # fmt: skip


def stack(count: int) -> Sequence[float]:
    return [-1e-3 * k for k in range(count)]


@pytest.mark.hard_case(
    "Materials", "1000 layers of presence 0.001, before the sky", expected="0.999^1000, to five standard errors"
)
def test_presence_stack(measured: Measured) -> None:
    found = show(camera_at(4.0), dome(), plates("m", stack(1000)), presence(0.001), spp=32)
    wanted = 0.999**1000
    assert abs(found.mean - wanted) < 5 * found.noise + 1e-3
    assert found.image.report["rays"] < 2000 * found.image.report["samples"]
    measured(f"{found.mean / wanted:.2f} of it")


@pytest.mark.hard_case("Materials", "1000 transparent layers of opacity 0.001, ior 1, before the sky", expected="0.999^1000")
def test_transparent_stack(measured: Measured) -> None:
    film = material(
        "m", "float inputs:opacity = 0.001", "color3f inputs:diffuseColor = (0, 0, 0)", "float inputs:ior = 1",
        "float inputs:roughness = 0", "int inputs:useSpecularWorkflow = 1",
    )  # fmt: skip
    found = show(ORTHOGRAPHIC, dome(), plates("m", stack(1000)), film, spp=16)
    np.testing.assert_allclose(found.pixels, 0.999**1000, rtol=2e-4)
    measured(f"{found.mean / 0.999**1000:.4f} of it")


@pytest.mark.parametrize("lamp", ["sun", "rect"])
@pytest.mark.hard_case("Materials", "the shadow of 1000 layers of presence 0.001: %s", expected="0.999^1000 of the light")
def test_shadow_of_a_stack(lamp: str, measured: Measured) -> None:
    lamps = {
        "sun": light("DistantLight", "float inputs:angle = 0", "float inputs:intensity = 1"),
        "rect": light("RectLight", at=placed(z=2.0)),
    }
    below = orthographic(0.2, -1.5)
    floor = plates("white", [-2.0], name="floor") + material("white", "float inputs:roughness = 1")
    common = (below, lamps[lamp], floor)
    bare = show(*common, spp=16, max_depth=1)
    shadowed = show(*common, plates("m", stack(1000)), presence(0.001), spp=16, max_depth=1)
    np.testing.assert_allclose(shadowed.pixels, bare.pixels * 0.999**1000, rtol=5e-3)  # rays that meet the lamp are few
    measured(f"{shadowed.mean / bare.mean / 0.999**1000:.4f} of it")


@pytest.mark.parametrize("angle", [0.0, 60.0])
def test_one_transparent_layer_reflects_as_the_quadrature_says(angle: float) -> None:
    """A pane of opacity 0.5 under a sky of 1, against the surface model integrated by itself."""
    c, s = 5 * math.cos(math.radians(angle)), 5 * math.sin(math.radians(angle))
    pane = prim(
        "Mesh", "pane", "int[] faceVertexCounts = [4]", "int[] faceVertexIndices = [0, 1, 2, 3]", FLAT, bound("m"),
        f"point3f[] points = [(-5, {-c!r}, {-s!r}), (5, {-c!r}, {-s!r}), (5, {c!r}, {s!r}), (-5, {c!r}, {s!r})]",
        apis=["MaterialBindingAPI"],
    )  # fmt: skip
    half = material(
        "m", "float inputs:opacity = 0.5", "color3f inputs:diffuseColor = (0.8, 0.8, 0.8)", "float inputs:roughness = 0.3"
    )
    found = show(ORTHOGRAPHIC, dome(), pane, half, spp=1024)
    surface = Surface("", diffuse_color=(0.8,) * 3, opacity=0.5, roughness=0.3, thin=True)
    wanted = PreviewSurface(surface).albedo(math.cos(math.radians(angle)))
    assert abs(found.mean - wanted) < 5 * found.noise + 1e-3
