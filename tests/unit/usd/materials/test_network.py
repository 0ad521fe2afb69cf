"""Shading networks as inputs of surfaces: every reader, every way to connect, and every way to get it wrong."""

from __future__ import annotations

import pytest

from primray.description import PrimvarInput, TextureFile, TextureInput, Wrap
from primray.diagnostics import STRICT
from primray.errors import UnsupportedError
from primray.settings import RenderSettings
from primray.usd import translate

from ..material_text import IMAGE, READER, input_of, material, node, surface_of, texture
from ..usd_text import stage_of, translate_text

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
    assert found == [("connection-type", "/m/r"), ("material-input", "/m/s")]


def test_a_reader_that_names_nothing() -> None:
    description, found = translate_text(
        material("float inputs:metallic.connect = </m/r.outputs:result>", node("r", "UsdPrimvarReader_float", ""))
    )
    assert ("primvar-missing", "/m/r") in found
    assert (description.surfaces[0].inputs, description.surfaces[0].metallic) == ((), 0)


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
    assert (surface.roughness, found) == (0.5, [("shader-connection", "/m")])


def test_several_connections() -> None:
    interface = "float inputs:a = 0.25\n float inputs:b = 0.75"
    surface, found = surface_of(
        material("float inputs:roughness.connect = [</m.inputs:a>, </m.inputs:b>]", interface=interface)
    )
    assert (surface.roughness, found) == (0.25, [("shader-connection", "/m/s")])


def test_outputs_that_a_texture_does_not_have(image: str) -> None:
    surface, found = surface_of(
        material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgba>", READER + IMAGE % image)
    )
    assert (surface.inputs, found) == ((), [("shader-connection", "/m/image"), ("material-input", "/m/s")])


def test_nodes_that_are_not_known() -> None:
    for identifier, code in (("ND_no_such_node", "shader-ignored"), ("UsdTransform2d", "connection-type")):
        surface, found = surface_of(
            material("color3f inputs:diffuseColor.connect = </m/n.outputs:result>", node("n", identifier, ""))
        )
        assert (surface.diffuse_color, found) == ((0.18, 0.18, 0.18), [(code, "/m/s")])


def test_numbers_for_a_text() -> None:
    image = node("n", "ND_image_float", "string inputs:layer.connect = </m/reader.outputs:result>", "float outputs:out")
    surface, found = surface_of(material("float inputs:roughness.connect = </m/n.outputs:out>", image + READER))
    assert ("connection-type", "/m/n") in found
    assert surface.roughness == 0.0


def test_values_of_the_wrong_type() -> None:
    surface, found = surface_of(material('token inputs:roughness = "high"\n float inputs:diffuseColor = 1'))
    assert (surface.roughness, surface.diffuse_color) == (0.5, (0.18, 0.18, 0.18))
    assert found == [("wrong-type", "/m/s"), ("wrong-type", "/m/s")]


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
    assert (surface.inputs, found) == ((), [("material-input", "/m/s")])


def test_displacement_of_a_sphere_is_told_unless_it_is_zero(image: str) -> None:
    assert surface_of(material("float inputs:displacement = 0"))[1] == []
    assert surface_of(material("float inputs:displacement = 1"))[1] == [("displacement", "/ball")]
    file = f"asset inputs:file = @{image}@"
    connected = material("float inputs:displacement.connect = </m/t.outputs:r>", node("t", "UsdUVTexture", file))
    assert ("displacement", "/ball") in surface_of(connected)[1]


def test_inputs_that_mean_nothing() -> None:
    assert surface_of(material("float inputs:occlusion = 0.5"))[1] == []
    assert surface_of(material("float inputs:specular = 0.5"))[1] == [("unknown-input", "/m/s")]


def test_emission_from_a_texture_needs_no_default_light(image: str) -> None:
    text = material("color3f inputs:emissiveColor.connect = </m/image.outputs:rgb>", READER + IMAGE % image)
    assert translate_text(text)[0].lights == ()


def test_other_networks_leave_the_display_color() -> None:
    for identifier in ("ND_gooch_shade", "PxrMarschnerHair", "arnold:car_paint"):
        red = "color3f[] primvars:displayColor = [(1, 0, 0)]\n rel material"
        surface, found = surface_of(material("", shader=identifier).replace("rel material", red))
        assert (surface.path, surface.lambert, surface.diffuse_color) == ("", True, (1, 0, 0))
        assert found == [("shader-ignored", "/m")]
    assert surface_of(material("", shader="PxrMarschnerHair"))[0].diffuse_color == (0.18, 0.18, 0.18)


def test_of_several_networks_the_one_that_is_known() -> None:
    known = "token outputs:surface.connect = </m/s.outputs:surface>"
    outputs = (
        f"token outputs:surface.connect = </m/o.outputs:out>\n {known.replace('outputs:surface', 'outputs:glslfx:surface', 1)}"
    )
    text = material("float inputs:roughness = 0.25", node("o", "ND_surface", "", "token outputs:out"))
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
        TextureFile(image, "sRGB"),
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
                diagnostics.raise_if_refused(STRICT)
        else:
            diagnostics.raise_if_refused(STRICT)
