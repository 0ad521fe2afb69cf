"""Rendering in other spaces than Rec.709: greys to the bit, one bounce in closed form, files that say it, previews alike."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
from pxr import Usd
from tests.colorimetry import AP1, between
from tests.colorimetry import REC709 as PUBLISHED

import primray
from primray.cli import run
from primray.color import ocio as color
from primray.color.color_space import ACESCG, REC709, matrix, named, transformed
from primray.images.image import encode
from primray.images.reading import read_measured

TO_AP1, FROM_AP1 = between(PUBLISHED, AP1), between(AP1, PUBLISHED)
WALL, LIGHT = (0.7, 0.1, 0.05), (0.3, 0.6, 2.0)

# A wall that a distant light meets head-on and nothing else: L = albedo / pi * E, one bounce, no noise.
SCENE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "cam"
{
    token projection = "orthographic"
    float horizontalAperture = 10
    float verticalAperture = 10
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "wall"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [%s]
}
def DistantLight "sun"
{
    float inputs:angle = 0
    float inputs:intensity = 2
    color3f inputs:color = %s (colorSpace = "lin_rec709_scene")
}
"""
# Light goes about between a floor, a ball and a wall, of one grey or of several colours.
ROOM = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "cam"
{
    float focalLength = 30
    float2 clippingRange = (0.1, 100)
    double3 xformOp:translate = (0, 1, 6)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "floor"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-5, 0, -5), (-5, 0, 5), (5, 0, 5), (5, 0, -5)]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [%s] (interpolation = "vertex")
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    double radius = 1
    double3 xformOp:translate = (0, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </m>
}
def Material "m"
{
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = %s
        float inputs:roughness = 0.3
        token outputs:surface
    }
}
def SphereLight "lamp"
{
    float inputs:intensity = 60
    double3 xformOp:translate = (3, 4, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky"
{
    float inputs:intensity = 0.3
}
"""
GREYS = "(0.8, 0.8, 0.8), (0.1, 0.1, 0.1), (0.3, 0.3, 0.3), (0.5, 0.5, 0.5)"
COLORS = "(0.8, 0.2, 0.1), (0.1, 0.7, 0.2), (0.1, 0.2, 0.8), (0.7, 0.6, 0.1)"

Pixels = npt.NDArray[np.float32]


def rendered(text: str, space: str | None, **more: int) -> primray.Image:
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(text)
    settings = {"resolution": (32, 24), "spp": 16} | more
    return primray.render(stage, primray.RenderSettings(camera="/cam", rendering_color_space=space, **settings))  # type: ignore[arg-type]


def rgb(image: primray.Image) -> Pixels:
    return image.pixels[..., :3]


@pytest.mark.conforms("RenderSettings.renderingColorSpace")
@pytest.mark.parametrize("name", ["lin_ap1_scene", "lin_rec2020_scene", "lin_p3d65_scene"])
def test_grey_is_the_same_to_the_bit(name: str) -> None:
    text = ROOM % (GREYS, (0.4, 0.4, 0.4))
    here, there = rendered(text, None), rendered(text, name)
    space = named(name)
    assert space is not None
    assert np.array_equal(transformed(rgb(there), matrix(space, REC709)), rgb(here))
    assert there.report["pixels_sha256"] == here.report["pixels_sha256"]


@pytest.mark.conforms("RenderSettings.renderingColorSpace", "LightAPI.inputs:color", "Gprim.primvars:displayColor")
def test_one_bounce_is_a_product_in_the_rendering_space() -> None:
    """(M a) (M e) / pi, which taken back is not a e / pi: colours multiply otherwise in other spaces."""
    text = SCENE % (WALL, LIGHT)
    found = rgb(rendered(text, "lin_ap1_scene", spp=2))
    expected = (TO_AP1 @ WALL) * (TO_AP1 @ LIGHT) * 2 / np.pi
    assert np.allclose(found, expected, rtol=3e-6)
    here = np.array(WALL) * np.array(LIGHT) * 2 / np.pi
    assert np.allclose(rgb(rendered(text, None, spp=2)), here, rtol=3e-6)
    back = FROM_AP1 @ expected
    assert np.abs(back / here - 1).max() > 0.05


def test_colors_are_about_the_same_and_look_about_the_same() -> None:
    text = ROOM % (COLORS, (0.1, 0.3, 0.8))
    here, there = rendered(text, None, spp=64), rendered(text, "lin_ap1_scene", spp=64)
    back = transformed(rgb(there), matrix(ACESCG, REC709))
    assert np.abs(back - rgb(here)).mean() < 0.02 * rgb(here).mean()
    assert np.abs(rgb(there) - rgb(here)).mean() > 0.04 * rgb(here).mean()  # as numbers they are not alike
    shown = [encode(image.pixels, space=image.color_space).astype(int)[..., :3] for image in (here, there)]
    assert np.abs(shown[0] - shown[1]).mean() < 1.5
    wrong = encode(there.pixels).astype(int)[..., :3]
    assert np.abs(wrong - shown[0]).mean() > 2 * np.abs(shown[0] - shown[1]).mean()


def test_files_say_the_space_and_pictures_of_two_are_not_compared(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(SCENE % (WALL, LIGHT))
    for name, flags in (("rec709", []), ("ap1", ["--rendering-color-space", "lin_ap1_scene"])):
        outputs = ["-o", str(tmp_path / f"{name}.exr"), "--report", str(tmp_path / f"{name}.json")]
        assert run(["render", str(tmp_path / "a.usda"), *outputs, "--res", "8", "8", "--spp", "4", *flags]) == 0
    file = oiio.ImageInput.open(str(tmp_path / "ap1.exr"))
    assert file is not None
    spec = file.spec()
    assert spec.getattribute("oiio:ColorSpace") == spec.getattribute("colorInteropID") == "lin_ap1_scene"
    assert np.allclose(spec.getattribute("chromaticities"), np.ravel(AP1), atol=1e-6)
    assert spec.getattribute("primray:color_space.name") == "lin_ap1_scene"
    report = json.loads((tmp_path / "ap1.json").read_text())
    corners = {name: list(getattr(ACESCG, name)) for name in ("red", "green", "blue", "white")}
    assert report["color_space"] == {"name": "lin_ap1_scene", **corners}
    assert report["settings"]["rendering_color_space"] == "lin_ap1_scene"
    rec709 = read_measured(tmp_path / "rec709.exr")
    assert rec709.chromaticities is not None
    assert np.allclose(rec709.chromaticities, np.ravel(PUBLISHED), atol=1e-6)
    pair = [str(tmp_path / "rec709.exr"), str(tmp_path / "ap1.exr")]
    assert run(["compare", *pair]) == 2
    assert run(["compare", pair[1], pair[1]]) == 0


def test_the_displays_error_is_that_of_the_view() -> None:
    """The same noise of a grey room has one error on the display, whatever space it was rendered in."""
    text = ROOM % (GREYS, (0.4, 0.4, 0.4))
    found = [rendered(text, name).report["error"]["display"]["estimate"] for name in (None, "lin_ap1_scene")]
    assert found[1] == pytest.approx(found[0], rel=1e-4)


def test_resumed_and_merged_pictures_stay_in_their_space(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(SCENE % (WALL, LIGHT))
    flags = ["render", str(tmp_path / "a.usda"), "--res", "8", "8", "--rendering-color-space", "lin_ap1_scene"]
    parts = []
    for k in range(2):
        parts.append(str(tmp_path / f"part{k}.prc"))
        span = ["--sample-range", f"{4 * k}:{4 * k + 4}", "--checkpoint", parts[-1]]
        assert run([*flags, *span, "-o", str(tmp_path / "part.exr")]) == 0
    assert run(["merge", *parts, "-o", str(tmp_path / "m.exr"), "-o", str(tmp_path / "m.png")]) == 0
    assert run([*flags, "--spp", "8", "-o", str(tmp_path / "w.exr"), "-o", str(tmp_path / "w.png")]) == 0
    merged, whole = read_measured(tmp_path / "m.exr"), read_measured(tmp_path / "w.exr")
    assert merged.metadata["color_space.name"] == "lin_ap1_scene"
    assert np.array_equal(merged.pixels, whole.pixels)
    shown = [np.asarray(oiio.ImageBuf(str(tmp_path / f"{name}.png")).get_pixels(oiio.UINT8)) for name in "mw"]
    assert np.array_equal(shown[0], shown[1])
    # A checkpoint of one space is no beginning of a picture in another.
    begun = str(tmp_path / "begun.prc")
    assert run([*flags, "--spp", "4", "--checkpoint", begun, "-o", str(tmp_path / "x.exr")]) == 0
    other = [flag if flag != "lin_ap1_scene" else "lin_rec709_scene" for flag in flags]
    assert run([*other, "--spp", "8", "--resume", begun, "-o", str(tmp_path / "x.exr")]) != 0


def test_a_look_and_a_display_reach_the_png(tmp_path: Path) -> None:
    """A red beyond Rec.709 is what the reference gamut compression compresses."""
    (tmp_path / "a.usda").write_text(SCENE % ((0.9, 0.9, 0.9), (8.0, 0.01, 0.01)))
    flags = ["render", str(tmp_path / "a.usda"), "--res", "8", "8", "--spp", "4", "--view", "Un-tone-mapped"]
    shown = {}
    for name, more in (("plain", []), ("look", ["--look", color.looks()[0]]), ("p3", ["--display", "Display P3 - Display"])):
        assert run([*flags, *more, "-o", str(tmp_path / f"{name}.png")]) == 0
        shown[name] = np.asarray(oiio.ImageBuf(str(tmp_path / f"{name}.png")).get_pixels(oiio.UINT8)).astype(int)
    assert np.abs(shown["p3"] - shown["plain"]).max() > 5
    assert np.abs(shown["look"] - shown["plain"]).max() > 2
    assert run([*flags, "--look", "nonsense", "-o", str(tmp_path / "n.png")]) == 2
    assert run([*flags, "--display", "nonsense", "-o", str(tmp_path / "n.png")]) == 2
