"""Textures and their coordinates in shading networks: every parameter, every way to name a file, every transform."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Sdf, Usd

from primray.color.color_space import ACESCG
from primray.description import PrimvarInput, TextureFile, TextureInput, Wrap
from primray.diagnostics import Diagnostics
from primray.render import load_textures
from primray.settings import RenderSettings
from primray.usd import read_asset, translate

from ..material_text import IMAGE, READER, Codes, input_of, material, node, surface_of, texture


def test_a_texture_with_all_its_parameters(image: str) -> None:
    parameters = """
        token inputs:wrapS = "repeat"
        token inputs:wrapT = "mirror"
        float4 inputs:fallback = (0.1, 0.2, 0.3, 0.4)
        float4 inputs:scale = (2, 3, 4, 5)
        float4 inputs:bias = (-1, -2, -3, -4)
        token inputs:sourceColorSpace = "sRGB"
        asset inputs:file"""
    surface, found = surface_of(
        material(
            "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>",
            READER + (IMAGE % image).replace("        asset inputs:file", parameters),
        )
    )
    assert found == []
    made = input_of(surface)
    assert isinstance(made, TextureInput)
    assert (made.file, made.channels, made.st) == (TextureFile(image, "sRGB"), "rgb", PrimvarInput("uv", (0, 0)))
    assert (made.wrap_s, made.wrap_t) == (Wrap.REPEAT, Wrap.MIRROR)
    assert (made.scale, made.bias) == ((2, 3, 4, 5), (-1, -2, -3, -4))
    assert made.fallback == pytest.approx((0.1, 0.2, 0.3, 0.4))
    assert surface.diffuse_color == pytest.approx((0.1, 0.2, 0.3))  # stands where the file cannot be read


def test_defaults_of_a_texture(image: str) -> None:
    surface, found = surface_of(
        material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", READER + IMAGE % image)
    )
    assert found == []
    assert texture(surface) == TextureInput(TextureFile(image, "auto"), "rgb", PrimvarInput("uv", (0, 0)))


@pytest.mark.parametrize("channel", ["r", "g", "b", "a"])
def test_single_channels(channel: str, image: str) -> None:
    """Also from outputs that are not authored."""
    surface, found = surface_of(
        material(f"float inputs:roughness.connect = </m/image.outputs:{channel}>", READER + IMAGE % image)
    )
    assert (texture(surface, "roughness").channels, found) == (channel, [])
    assert surface.roughness == (1 if channel == "a" else 0)


@pytest.mark.parametrize(
    ("inputs", "channels", "field"),
    [
        ("float inputs:roughness.connect = </m/image.outputs:rgb>", "r", "roughness"),
        ("color3f inputs:diffuseColor.connect = </m/image.outputs:a>", "a", "diffuse_color"),
    ],
)
def test_outputs_of_another_width_are_used_and_told(inputs: str, channels: str, field: str, image: str) -> None:
    surface, found = surface_of(material(inputs, READER + IMAGE % image))
    assert texture(surface, field).channels == channels
    assert found == [("connection-type", "/m/image")]


def test_a_missing_file_is_its_fallback() -> None:
    nodes = READER + (IMAGE % "no.png").replace(
        "float2 inputs:st", "float4 inputs:fallback = (1, 0.5, 0.25, 1)\n        float2 inputs:st"
    )
    surface, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", nodes))
    assert (surface.inputs, surface.diffuse_color) == ((), (1, 0.5, 0.25))
    assert found == [("asset-missing", "/m/image")]


def test_a_texture_that_names_no_file() -> None:
    surface, found = surface_of(material("float inputs:metallic.connect = </m/t.outputs:a>", node("t", "UsdUVTexture", "")))
    assert (surface.inputs, surface.metallic, found) == ((), 1, [("texture-unset", "/m/t")])


def test_a_missing_normal_map_leaves_the_normal() -> None:
    surface, _ = surface_of(material("normal3f inputs:normal.connect = </m/image.outputs:rgb>", READER + IMAGE % "no.png"))
    assert surface.inputs == ()


@pytest.mark.conforms("UsdUVTexture.inputs:file")
def test_udim_tiles(tmp_path: Path) -> None:
    for number in (1001, 1012, 1100, 1101, 2000):
        oiio.ImageBuf(np.ones((1, 1, 3), np.float32)).write(str(tmp_path / f"t.{number}.png"), "uint8")
    text = material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", READER + IMAGE % "./t.<UDIM>.png")
    (tmp_path / "a.usda").write_text("#usda 1.0\n" + text)
    description, _ = translate(Usd.Stage.Open(str(tmp_path / "a.usda")), RenderSettings())
    file = texture(description.surfaces[0]).file
    assert file.path == str(tmp_path / "t.<UDIM>.png")
    assert file.tiles == tuple((n, str(tmp_path / f"t.{n}.png")) for n in (1001, 1012, 1100))


def test_no_tiles_are_a_missing_file(tmp_path: Path) -> None:
    surface, found = surface_of(
        material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", READER + IMAGE % f"{tmp_path}/t.<UDIM>.png")
    )
    assert (surface.inputs, found) == ((), [("asset-missing", "/m/image")])


@pytest.mark.parametrize(
    ("authored", "expected"),
    [
        ("", "auto"),
        ('token inputs:sourceColorSpace = "raw"', "raw"),
        ('token inputs:sourceColorSpace = "auto"', "auto"),
        ('token inputs:sourceColorSpace = "linear"', "auto"),
    ],
)
@pytest.mark.conforms("UsdUVTexture.inputs:sourceColorSpace")
def test_source_color_space(authored: str, expected: str, image: str) -> None:
    nodes = READER + (IMAGE % image).replace("float2 inputs:st", f"{authored}\n        float2 inputs:st")
    surface, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", nodes))
    assert texture(surface).file.color_space == expected
    assert found == ([("shader-parameter", "/m/image")] if "linear" in authored else [])


def test_color_space_of_the_asset(image: str) -> None:
    """Metadata of the attribute that has the file, unless sourceColorSpace says raw or sRGB."""
    inputs = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>"
    for space, expected in (("lin_ap1_scene", ACESCG), ("data", "raw"), ("srgb_rec709_scene", "sRGB")):
        nodes = READER + (IMAGE % image).replace(f"@{image}@", f'@{image}@ (colorSpace = "{space}")')
        assert texture(surface_of(material(inputs, nodes))[0]).file.color_space == expected
    nodes = nodes.replace("float2 inputs:st", 'token inputs:sourceColorSpace = "sRGB"\n        float2 inputs:st')
    assert texture(surface_of(material(inputs, nodes))[0]).file.color_space == "sRGB"


def test_file_and_parameters_by_interface(image: str) -> None:
    """With the colour space of the interface's own attribute."""
    interface = f"""
    asset inputs:map = @{image}@ (colorSpace = "lin_ap1_scene")
    float4 inputs:gain = (2, 2, 2, 1)
    token inputs:how = "clamp"
    string inputs:which = 'st3'"""
    nodes = """
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file.connect = </m.inputs:map>
        float4 inputs:scale.connect = </m.inputs:gain>
        token inputs:wrapS.connect = </m.inputs:how>
        float2 inputs:st.connect = </m/r.outputs:result>
        float3 outputs:rgb
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname.connect = </m.inputs:which>
        float2 outputs:result
    }"""
    surface, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>", nodes, interface))
    made = texture(surface)
    assert found == []
    assert (made.file, made.scale) == (TextureFile(image, ACESCG), (2, 2, 2, 1))
    assert (made.wrap_s, made.wrap_t, made.st.name) == (Wrap.CLAMP, Wrap.USE_METADATA, "st3")


def test_an_unknown_wrap_mode(image: str) -> None:
    nodes = READER + (IMAGE % image).replace("float2 inputs:st", 'token inputs:wrapT = "round"\n        float2 inputs:st')
    surface, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", nodes))
    assert (texture(surface).wrap_t, found) == (Wrap.USE_METADATA, [("shader-parameter", "/m/image")])


def st_of(st: str, nodes: str, image: str) -> tuple[TextureInput, Codes]:
    """A texture whose st is authored as said."""
    text = (IMAGE % image).replace("float2 inputs:st.connect = </m/reader.outputs:result>", st)
    surface, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", nodes + text))
    return texture(surface), found


def test_st_from_a_constant_and_from_nothing(image: str) -> None:
    assert st_of("float2 inputs:st = (0.25, 0.75)", "", image)[0].st == PrimvarInput("", (0.25, 0.75))
    assert st_of("", "", image)[0].st == PrimvarInput("", (0, 0))
    wrong, found = st_of('token inputs:st = "st"', "", image)
    assert (wrong.st, found) == (PrimvarInput("", (0, 0)), [("wrong-type", "/m/image")])


@pytest.mark.conforms(
    "UsdTransform2d.inputs:in",
    "UsdTransform2d.inputs:scale",
    "UsdTransform2d.inputs:rotation",
    "UsdTransform2d.inputs:translation",
)
def test_transforms_scale_then_rotate_then_translate(image: str) -> None:
    """(u, v) = (1, 0): scaled to (2, 0), a quarter turn counter-clockwise to (0, 2), moved to (0.5, 2.25)."""
    inputs = """float2 inputs:in.connect = </m/reader.outputs:result>
        float2 inputs:scale = (2, 3)
        float inputs:rotation = 90
        float2 inputs:translation = (0.5, 0.25)"""
    made, found = st_of("float2 inputs:st.connect = </m/t.outputs:result>", READER + node("t", "UsdTransform2d", inputs), image)
    assert found == []
    assert (made.st, made.st_transform) == (PrimvarInput("uv", (0, 0)), (0, -3, 0.5, 2, 0, 0.25))


@pytest.mark.parametrize("degrees", [30, -45, 180, 270, 360, 725])
def test_rotations(degrees: float, image: str) -> None:
    inputs = f"float2 inputs:in.connect = </m/reader.outputs:result>\n float inputs:rotation = {degrees}"
    made, _ = st_of("float2 inputs:st.connect = </m/t.outputs:result>", READER + node("t", "UsdTransform2d", inputs), image)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    assert made.st_transform == pytest.approx((c, -s, 0, s, c, 0), abs=1e-12)


def test_a_chain_of_transforms_is_one_matrix(image: str) -> None:
    first = "float2 inputs:in.connect = </m/reader.outputs:result>\n float2 inputs:translation = (1, 0)"
    last = "float2 inputs:in.connect = </m/t1.outputs:result>\n float2 inputs:scale = (2, 2)"
    nodes = READER + node("t1", "UsdTransform2d", first) + node("t2", "UsdTransform2d", last)
    made, found = st_of("float2 inputs:st.connect = </m/t2.outputs:result>", nodes, image)
    assert (made.st_transform, found) == ((2, 0, 2, 0, 2, 0), [])  # moved, then scaled


def test_a_transform_of_a_constant_or_of_nothing(image: str) -> None:
    constant = node("t", "UsdTransform2d", "float2 inputs:in = (1, 1)\n float2 inputs:scale = (2, 2)")
    made, _ = st_of("float2 inputs:st.connect = </m/t.outputs:result>", constant, image)
    assert (made.st, made.st_transform[0]) == (PrimvarInput("", (1, 1)), 2)
    made, _ = st_of("float2 inputs:st.connect = </m/t.outputs:result>", node("t", "UsdTransform2d", ""), image)
    assert made.st == PrimvarInput("", (0, 0))


def test_transforms_in_a_circle(image: str) -> None:
    nodes = node("t1", "UsdTransform2d", "float2 inputs:in.connect = </m/t2.outputs:result>")
    nodes += node("t2", "UsdTransform2d", "float2 inputs:in.connect = </m/t1.outputs:result>")
    made, found = st_of("float2 inputs:st.connect = </m/t1.outputs:result>", nodes, image)
    assert (made.st, [code for code, _ in found]) == (PrimvarInput("", (0, 0)), ["shader-connection", "material-input"])


def test_st_from_a_node_that_gives_none(image: str) -> None:
    made, found = st_of("float2 inputs:st.connect = </m/n.outputs:out>", node("n", "ND_noise", "", "float2 outputs:out"), image)
    assert (made.st, found) == (PrimvarInput("", (0, 0)), [("shader-ignored", "/m/image")])


def test_st_from_readers_of_more_numbers(image: str) -> None:
    nodes = node("r", "UsdPrimvarReader_float3", 'string inputs:varname = "uvw"\n float3 inputs:fallback = (1, 2, 3)')
    made, found = st_of("float2 inputs:st.connect = </m/r.outputs:result>", nodes, image)
    assert (made.st, found) == (PrimvarInput("uvw", (1, 2)), [])


NETWORK = """#usda 1.0
(
    expressionVariables = { string which = "a" }
)
%s
"""


def test_files_in_packages_in_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A plain member, a set of tiles, and a path by an expression of the stage's variables."""
    monkeypatch.chdir(tmp_path)
    for name in ("a", "t.1001", "t.1002"):
        oiio.ImageBuf(np.full((1, 1, 3), 0.5, np.float32)).write(f"{name}.png", "uint8")
    inputs = "\n".join(
        f"color3f inputs:{name}.connect = </m/{node}.outputs:rgb>"
        for name, node in (("diffuseColor", "plain"), ("emissiveColor", "tiles"), ("specularColor", "named"))
    )
    files = {"plain": "a.png", "tiles": "t.<UDIM>.png", "named": '`"${which}.png"`'}
    nodes = "".join(node(n, "UsdUVTexture", f"asset inputs:file = @{f}@", "float3 outputs:rgb") for n, f in files.items())
    Path("inner.usda").write_text(NETWORK % material(inputs, nodes))
    Path("outer.usda").write_text(OUTER)
    package("inner.usdz", "inner.usda", "a.png", "t.1001.png", "t.1002.png")
    package("outer.usdz", "outer.usda", "inner.usdz")
    diagnostics = Diagnostics()
    description, found = translate(Usd.Stage.Open("outer.usdz"), RenderSettings())
    inside = f"{tmp_path}/outer.usdz[inner.usdz["
    made = {name: made.file for name, made in description.surfaces[0].inputs if isinstance(made, TextureInput)}
    assert made["diffuse_color"].path == made["specular_color"].path == inside + "a.png]]"
    assert made["emissive_color"].path == inside + "t.<UDIM>.png]]"
    assert [n for n, _ in made["emissive_color"].tiles] == [1001, 1002]
    _, textures = load_textures(description, diagnostics, read_asset)
    assert list(diagnostics) == []
    assert {len(images) for images in textures.values()} == {1, 2}
    assert all(np.allclose(t.pixels, 0.2159, atol=1e-3) for images in textures.values() for _, t in images)
    assert {d.code for d in found} <= {"camera-automatic", "default-light"}


OUTER = """#usda 1.0
def Material "m" (references = @inner.usdz@</m>)
{
}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </m>
}
"""


def package(name: str, *files: str) -> None:
    writer = Sdf.ZipFileWriter.CreateNew(name)
    for file in files:
        writer.AddFile(file)
    assert writer.Save()
