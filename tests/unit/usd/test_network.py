"""Shading networks as inputs of surfaces: every node type, every way to connect, and every way to get it wrong."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd

from primray.description import Input, PrimvarInput, Surface, TextureFile, TextureInput, Wrap
from primray.errors import UnsupportedError
from primray.settings import RenderSettings
from primray.usd import translate

from .usd_text import stage_of, translate_text

Codes = list[tuple[str, str]]

READER = """
    def Shader "reader"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "uv"
        float2 outputs:result
    }"""
IMAGE = """
    def Shader "image"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @%s@
        float2 inputs:st.connect = </m/reader.outputs:result>
        float3 outputs:rgb
        float outputs:a
    }"""


def material(inputs: str, nodes: str = "", interface: str = "", shader: str = "UsdPreviewSurface") -> str:
    return f"""
def Material "m"
{{
    {interface}
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "{shader}"
        {inputs}
        token outputs:surface
    }}
    {nodes}
}}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </m>
}}
"""


def surface_of(text: str) -> tuple[Surface, Codes]:
    """The ball's surface, and the diagnostics that are not about cameras and lights."""
    description, found = translate_text(text)
    shape = description.shapes[0]
    ignored = {"camera-automatic", "default-light", "primvar-missing"}
    return description.surfaces[int(np.asarray(shape.surface))], [d for d in found if d[0] not in ignored]


def input_of(surface: Surface, name: str = "diffuse_color") -> Input:
    return dict(surface.inputs)[name]


def node(name: str, identifier: str, inputs: str, output: str = "float2 outputs:result") -> str:
    return f"""
    def Shader "{name}"
    {{
        uniform token info:id = "{identifier}"
        {inputs}
        {output}
    }}"""


@pytest.fixture
def image(tmp_path: Path) -> str:
    path = tmp_path / "a.png"
    oiio.ImageBuf(np.ones((1, 1, 3), np.float32)).write(str(path), "uint8")
    return str(path)


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


def texture(surface: Surface, name: str = "diffuse_color") -> TextureInput:
    made = input_of(surface, name)
    assert isinstance(made, TextureInput)
    return made


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
def test_source_color_space(authored: str, expected: str, image: str) -> None:
    nodes = READER + (IMAGE % image).replace("float2 inputs:st", f"{authored}\n        float2 inputs:st")
    surface, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", nodes))
    assert texture(surface).file.color_space == expected
    assert found == ([("shader-parameter", "/m/image")] if "linear" in authored else [])


def test_color_space_of_the_asset(image: str) -> None:
    """Metadata of the attribute that has the file, unless sourceColorSpace says raw or sRGB."""
    inputs = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>"
    for space, expected in (("lin_ap1_scene", "lin_ap1_scene"), ("data", "raw")):
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
    assert (made.file, made.scale) == (TextureFile(image, "lin_ap1_scene"), (2, 2, 2, 1))
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
    assert (made.st, [code for code, _ in found]) == (PrimvarInput("", (0, 0)), ["shader-ignored"])


def test_st_from_a_node_that_gives_none(image: str) -> None:
    made, found = st_of("float2 inputs:st.connect = </m/n.outputs:out>", node("n", "ND_noise", "", "float2 outputs:out"), image)
    assert (made.st, found) == (PrimvarInput("", (0, 0)), [("shader-ignored", "/m/image")])


READERS = {"float": 1, "int": 1, "float3": 3, "float4": 4, "normal": 3, "point": 3, "vector": 3}


@pytest.mark.parametrize("kind", READERS)
def test_readers_feed_inputs(kind: str) -> None:
    width = READERS[kind]
    field, target = ("roughness", "float inputs:roughness") if width == 1 else ("diffuse_color", "color3f inputs:diffuseColor")
    surface, found = surface_of(
        material(
            f"{target}.connect = </m/r.outputs:result>", node("r", f"UsdPrimvarReader_{kind}", 'string inputs:varname = "p"')
        )
    )
    assert (input_of(surface, field), found) == (PrimvarInput("p", (0.0,) * min(width, 3)), [])


@pytest.mark.parametrize(("kind", "text"), [("float", "float inputs:fallback = 0.25"), ("int", "int inputs:fallback = 1")])
def test_fallbacks_of_readers(kind: str, text: str) -> None:
    nodes = node("r", f"UsdPrimvarReader_{kind}", f'token inputs:varname = "p"\n{text}')
    surface, found = surface_of(material("float inputs:metallic.connect = </m/r.outputs:result>", nodes))
    expected = 0.25 if kind == "float" else 1
    assert (input_of(surface, "metallic"), surface.metallic, found) == (PrimvarInput("p", (expected,)), expected, [])


@pytest.mark.parametrize("kind", ["string", "matrix", "float", "float2"])
def test_readers_that_cannot_give_a_color(kind: str) -> None:
    nodes = node("r", f"UsdPrimvarReader_{kind}", 'string inputs:varname = "p"')
    surface, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/r.outputs:result>", nodes))
    assert (surface.inputs, surface.diffuse_color) == ((), (0.18, 0.18, 0.18))
    assert found == [("connection-type", "/m/r"), ("material-input", "/m")]


def test_st_from_readers_of_more_numbers(image: str) -> None:
    nodes = node("r", "UsdPrimvarReader_float3", 'string inputs:varname = "uvw"\n float3 inputs:fallback = (1, 2, 3)')
    made, found = st_of("float2 inputs:st.connect = </m/r.outputs:result>", nodes, image)
    assert (made.st, found) == (PrimvarInput("uvw", (1, 2)), [])


def test_a_reader_that_names_nothing() -> None:
    description, found = translate_text(
        material("float inputs:metallic.connect = </m/r.outputs:result>", node("r", "UsdPrimvarReader_float", ""))
    )
    assert ("primvar-missing", "/m/r") in found
    assert input_of(description.surfaces[0], "metallic") == PrimvarInput("", (0,))


def test_parameters_that_nodes_compute_are_at_their_default() -> None:
    nodes = node("r", "UsdPrimvarReader_float", "string inputs:varname.connect = </m/n.outputs:result>")
    nodes += node("n", "UsdPrimvarReader_string", 'string inputs:varname = "p"')
    _, found = surface_of(material("float inputs:metallic.connect = </m/r.outputs:result>", nodes))
    assert ("shader-ignored", "/m/r") in found


def test_nested_node_graphs(image: str) -> None:
    """The surface inside two graphs, its texture behind an interface of both."""
    text = f"""
def Material "m"
{{
    float inputs:shine = 0.25
    token outputs:surface.connect = </m/outer.outputs:surface>
    def NodeGraph "outer"
    {{
        float inputs:shine.connect = </m.inputs:shine>
        token outputs:surface.connect = </m/outer/inner.outputs:surface>
        def NodeGraph "inner"
        {{
            float inputs:shine.connect = </m/outer.inputs:shine>
            token outputs:surface.connect = </m/outer/inner/s.outputs:surface>
            def Shader "s"
            {{
                uniform token info:id = "UsdPreviewSurface"
                float inputs:roughness.connect = </m/outer/inner.inputs:shine>
                color3f inputs:diffuseColor.connect = </m/maps.outputs:color>
                token outputs:surface
            }}
        }}
    }}
    def NodeGraph "maps"
    {{
        float3 outputs:color.connect = </m/maps/t.outputs:rgb>
        def Shader "t"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{image}@
            float3 outputs:rgb
        }}
    }}
}}
def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </m>
}}
"""
    surface, found = surface_of(text)
    assert (surface.roughness, texture(surface).file.path, found) == (0.25, image, [])


def test_a_connection_wins_over_a_value_unless_it_leads_nowhere() -> None:
    """To no prim, to no attribute, to an interface without a value: then the value holds, and the first two are told."""
    interface = "float inputs:given = 0.75\n float inputs:empty"
    for target, expected, codes in (
        ("</m.inputs:given>", 0.75, []),
        ("</m.inputs:empty>", 0.25, []),
        ("</m/gone.outputs:r>", 0.25, ["shader-connection"]),
        ("</m.inputs:gone>", 0.25, ["shader-connection"]),
    ):
        inputs = f"float inputs:roughness = 0.25\n float inputs:roughness.connect = {target}"
        surface, found = surface_of(material(inputs, interface=interface))
        assert (surface.roughness, [code for code, _ in found]) == (expected, codes), target


def test_connections_in_a_circle_end() -> None:
    interface = "float inputs:a.connect = </m.inputs:b>\n float inputs:b.connect = </m.inputs:a>"
    surface, found = surface_of(material("float inputs:roughness.connect = </m.inputs:a>", interface=interface))
    assert (surface.roughness, found) == (0.5, [("shader-connection", "/m.inputs:a")])


def test_several_connections() -> None:
    interface = "float inputs:a = 0.25\n float inputs:b = 0.75"
    surface, found = surface_of(
        material("float inputs:roughness.connect = [</m.inputs:a>, </m.inputs:b>]", interface=interface)
    )
    assert (surface.roughness, found) == (0.25, [("shader-connection", "/m/s.inputs:roughness")])


def test_outputs_that_a_texture_does_not_have(image: str) -> None:
    surface, found = surface_of(
        material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgba>", READER + IMAGE % image)
    )
    assert (surface.inputs, found) == ((), [("shader-connection", "/m/image"), ("material-input", "/m")])


def test_nodes_that_are_not_known() -> None:
    for identifier, code in (("ND_noise2d_color3", "shader-ignored"), ("UsdTransform2d", "connection-type")):
        surface, found = surface_of(
            material("color3f inputs:diffuseColor.connect = </m/n.outputs:result>", node("n", identifier, ""))
        )
        assert (surface.diffuse_color, found) == ((0.18, 0.18, 0.18), [(code, "/m")])


def test_values_of_the_wrong_type() -> None:
    surface, found = surface_of(material('token inputs:roughness = "high"\n float inputs:diffuseColor = 1'))
    assert (surface.roughness, surface.diffuse_color) == (0.5, (0.18, 0.18, 0.18))
    assert found == [("wrong-type", "/m"), ("wrong-type", "/m")]


def test_cut_outs_that_vary_keep_their_threshold(image: str) -> None:
    inputs = "float inputs:opacity.connect = </m/image.outputs:a>\n float inputs:opacityThreshold = 0.5"
    surface, _ = surface_of(material(inputs, READER + IMAGE % image))
    assert (surface.opacity_threshold, texture(surface, "opacity").channels, surface.thin) == (0.5, "a", False)
    constant, _ = surface_of(material("float inputs:opacity = 0.75\n float inputs:opacityThreshold = 0.5"))
    assert (constant.opacity_threshold, constant.opacity) == (0, 1)


def test_opacity_that_varies(image: str) -> None:
    """A closed ball refracts, unless its index of refraction is 1."""
    inputs = 'float inputs:opacity.connect = </m/image.outputs:a>\n token inputs:opacityMode = "presence"'
    surface, _ = surface_of(material(inputs, READER + IMAGE % image))
    assert (surface.presence, surface.thin, surface.opacity) == (True, False, 1)
    surface, _ = surface_of(material(inputs + "\n float inputs:ior = 1", READER + IMAGE % image))
    assert surface.thin


def test_normals(image: str) -> None:
    surface, _ = surface_of(material("normal3f inputs:normal.connect = </m/image.outputs:rgb>", READER + IMAGE % image))
    assert texture(surface, "normal").channels == "rgb"
    assert surface_of(material("normal3f inputs:normal = (0, 0, 1)"))[0].inputs == ()
    surface, _ = surface_of(material("normal3f inputs:normal = (0, 1, 1)"))
    assert surface.inputs == (("normal", PrimvarInput("", (0, 1, 1))),)
    surface, found = surface_of(material("normal3f inputs:normal = (0, 0, 0)"))
    assert (surface.inputs, found) == ((), [("material-input", "/m")])


def test_displacement_is_told_unless_it_is_zero() -> None:
    assert surface_of(material("float inputs:displacement = 0"))[1] == []
    assert surface_of(material("float inputs:displacement = 1"))[1] == [("displacement", "/m")]
    connected = material("float inputs:displacement.connect = </m/t.outputs:r>", node("t", "UsdUVTexture", ""))
    assert surface_of(connected)[1] == [("displacement", "/m")]


def test_inputs_that_mean_nothing() -> None:
    assert surface_of(material("float inputs:occlusion = 0.5"))[1] == []
    assert surface_of(material("float inputs:specular = 0.5"))[1] == [("unknown-input", "/m")]


def test_emission_from_a_texture_needs_no_default_light(image: str) -> None:
    text = material("color3f inputs:emissiveColor.connect = </m/image.outputs:rgb>", READER + IMAGE % image)
    assert translate_text(text)[0].lights == ()


def test_other_networks_leave_the_display_color() -> None:
    for identifier in ("ND_standard_surface_surfaceshader", "PxrSurface", "arnold:standard_surface"):
        red = "color3f[] primvars:displayColor = [(1, 0, 0)]\n rel material"
        surface, found = surface_of(material("", shader=identifier).replace("rel material", red))
        assert (surface.path, surface.lambert, surface.diffuse_color) == ("", True, (1, 0, 0))
        assert found == [("shader-ignored", "/m")]
    assert surface_of(material("", shader="PxrSurface"))[0].diffuse_color == (0.18, 0.18, 0.18)


def test_of_several_networks_the_one_that_is_known() -> None:
    known = "token outputs:surface.connect = </m/s.outputs:surface>"
    outputs = (
        f"token outputs:surface.connect = </m/o.outputs:out>\n {known.replace('outputs:surface', 'outputs:glslfx:surface', 1)}"
    )
    text = material("float inputs:roughness = 0.25", node("o", "ND_open_pbr_surface_surfaceshader", "", "token outputs:out"))
    surface, found = surface_of(text.replace(known, outputs))
    assert (surface.path, surface.roughness, found) == ("/m", 0.25, [])


def test_materialx_nodes_of_the_same_meaning(image: str) -> None:
    nodes = f"""
    def Shader "t"
    {{
        uniform token info:id = "ND_image_color3"
        asset inputs:file = @{image}@ (colorSpace = "srgb_texture")
        color3f inputs:default = (0.5, 0.25, 1)
        float2 inputs:texcoord.connect = </m/g.outputs:out>
        string inputs:vaddressmode = "clamp"
        color3f outputs:out
    }}
    def Shader "g"
    {{
        uniform token info:id = "ND_geompropvalue_vector2"
        string inputs:geomprop = "map1"
        float2 outputs:out
    }}"""
    inputs = "color3f inputs:diffuseColor.connect = </m/t.outputs:out>\n int inputs:opacityMode = 1"
    surface, found = surface_of(material(inputs, nodes, shader="ND_UsdPreviewSurface_surfaceshader"))
    assert found == []
    assert surface.presence
    assert texture(surface) == TextureInput(
        TextureFile(image, "srgb_texture"),
        "rgb",
        PrimvarInput("map1", (0, 0)),
        wrap_s=Wrap.REPEAT,
        wrap_t=Wrap.CLAMP,
        fallback=(0.5, 0.25, 1, 1),
    )


def test_strict_mode_fails_on_what_differs_and_not_on_defaults() -> None:
    strict = RenderSettings(strict=True)
    for inputs, fails in (("float inputs:displacement = 1", True), ("float inputs:specular = 1", False)):
        diagnostics = translate(stage_of(material(inputs)), strict)[1]
        if fails:
            with pytest.raises(UnsupportedError, match="displacement"):
                diagnostics.raise_if_strict()
        else:
            diagnostics.raise_if_strict()
