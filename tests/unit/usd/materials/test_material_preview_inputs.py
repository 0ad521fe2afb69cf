"""Every input and output of UsdPreviewSurface and its nodes: authored, the description says what the definition does.

What these numbers do to light is held elsewhere (tests/statistics/surfaces/test_bsdf.py, tests/images).
"""

from __future__ import annotations

from typing import Any

import pytest
from pxr import Sdr

from primray.description import PrimvarInput, Surface, TextureFile, TextureInput, Wrap
from primray.settings import RenderSettings
from primray.usd import translate

from ..material_text import IMAGE, READER, input_of, material, node, surface_of, texture
from ..usd_text import stage_of, translate_text

SURFACE = "UsdPreviewSurface"


def conforms(row: str, *values: Any, state: str = "honoured") -> Any:
    return pytest.param(*values, marks=pytest.mark.conforms(row, state=state), id=row)


def constant(name: str, value: str, field: str, expected: Any, kind: str = "float") -> Any:
    return conforms(f"{SURFACE}.inputs:{name}", f"{kind} inputs:{name} = {value}", field, expected)


@pytest.mark.parametrize(
    ("authored", "field", "expected"),
    [
        constant("diffuseColor", "(0.1, 0.2, 0.3)", "diffuse_color", (0.1, 0.2, 0.3), "color3f"),
        constant("emissiveColor", "(1, 20, 3)", "emissive_color", (1, 20, 3), "color3f"),
        constant("specularColor", "(0.1, 0.2, 0.3)", "specular_color", (0.1, 0.2, 0.3), "color3f"),
        constant("useSpecularWorkflow", "1", "use_specular_workflow", True, "int"),
        constant("metallic", "0.25", "metallic", 0.25),
        constant("roughness", "0.25", "roughness", 0.25),
        constant("clearcoat", "0.25", "clearcoat", 0.25),
        constant("clearcoatRoughness", "0.25", "clearcoat_roughness", 0.25),
        constant("opacity", "0.25", "opacity", 0.25),
        constant("opacityMode", '"presence"', "presence", True, "token"),
        constant("ior", "2.5", "ior", 2.5),
    ],
)
def test_constants(authored: str, field: str, expected: Any) -> None:
    """Each changes its own field of the surface, and no other."""
    plain, _ = surface_of(material(""))
    made, found = surface_of(material(authored))
    assert getattr(made, field) == pytest.approx(expected)
    assert getattr(plain, field) != pytest.approx(expected)
    assert found == []
    others = [name for name in vars(plain) if name not in (field, "thin")]
    assert [getattr(made, name) for name in others] == [getattr(plain, name) for name in others]


def test_defaults_are_the_definitions() -> None:
    """As the shader registry that ships with USD has them."""
    registered = Sdr.Registry().GetShaderNodeByIdentifier(SURFACE)
    made, _ = surface_of(material(""))
    for name, field in {
        "diffuseColor": "diffuse_color",
        "emissiveColor": "emissive_color",
        "specularColor": "specular_color",
        "metallic": "metallic",
        "roughness": "roughness",
        "clearcoat": "clearcoat",
        "clearcoatRoughness": "clearcoat_roughness",
        "opacity": "opacity",
        "opacityThreshold": "opacity_threshold",
        "ior": "ior",
    }.items():
        default = registered.GetShaderInput(name).GetDefaultValue()
        assert getattr(made, field) == pytest.approx(default if isinstance(default, float) else tuple(default)), name


@pytest.mark.conforms(f"{SURFACE}.inputs:normal")
def test_a_constant_normal() -> None:
    made, _ = surface_of(material("normal3f inputs:normal = (0.6, 0, 0.8)"))
    assert input_of(made, "normal") == PrimvarInput("", pytest.approx((0.6, 0, 0.8)))  # type: ignore[arg-type]
    assert surface_of(material("normal3f inputs:normal = (0, 0, 1)"))[0].inputs == ()


@pytest.mark.conforms(f"{SURFACE}.inputs:opacityThreshold")
@pytest.mark.parametrize(("opacity", "shapes"), [(0.49, 0), (0.5, 1), (0.51, 1)])
def test_a_threshold_cuts_out_or_leaves_all(opacity: float, shapes: int) -> None:
    """At the threshold and above it is fully visible."""
    description, _ = translate_text(material(f"float inputs:opacity = {opacity}\n float inputs:opacityThreshold = 0.5"))
    assert len(description.shapes) == shapes
    assert not shapes or description.surfaces[0].opacity == 1


@pytest.mark.parametrize(
    ("terminal", "code"),
    [
        pytest.param("displacement", "displacement", id="Material.outputs:displacement"),
        conforms("Material.outputs:volume", "volume", "shader-ignored", state="diagnosed"),
    ],
)
def test_other_terminals_are_told(terminal: str, code: str) -> None:
    other = node("d", "ND_other", "", "token outputs:out")
    text = material("", other, f"token outputs:{terminal}.connect = </m/d.outputs:out>")
    found = [(d.code, d.attribute) for d in translate(stage_of(text), RenderSettings())[1] if d.prim_path == "/m"]
    assert found == [(code, f"outputs:{terminal}")]


@pytest.mark.conforms(f"{SURFACE}.inputs:occlusion", state="no effect")
def test_occlusion_is_what_a_path_tracer_computes() -> None:
    """The definition: "path tracers will likely choose to ignore it"."""
    plain, found = surface_of(material(""))
    assert surface_of(material("float inputs:occlusion = 0")) == (plain, found)


@pytest.mark.conforms(
    f"{SURFACE}.outputs:surface", "Material.outputs:surface", "ConnectableAPI.connections", "NodeDefAPI.info:id"
)
@pytest.mark.conforms("NodeDefAPI.info:implementationSource")
def test_the_surface_terminal() -> None:
    text = material("float inputs:roughness = 0.25")
    assert surface_of(text)[0].path == "/m"
    assert (
        surface_of(
            text.replace(
                'info:id = "UsdPreviewSurface"',
                'info:implementationSource = "id"\n uniform token info:id = "UsdPreviewSurface"',
            )
        )[0].path
        == "/m"
    )
    unconnected = text.replace("token outputs:surface.connect = </m/s.outputs:surface>", "")
    made, found = surface_of(unconnected)
    assert (made.path, made.lambert, [code for code, _ in found]) == ("", True, ["shader-ignored"])
    other, found = surface_of(text.replace("UsdPreviewSurface", "OtherSurface"))
    assert (other.lambert, [code for code, _ in found]) == (True, ["shader-ignored"])


@pytest.mark.parametrize(
    ("source", "authored"),
    [
        conforms(
            "NodeDefAPI.info:sourceAsset", "sourceAsset", "uniform asset info:sourceAsset = @./a.glslfx@", state="diagnosed"
        ),
        conforms("NodeDefAPI.info:sourceCode", "sourceCode", 'uniform string info:sourceCode = "void"', state="diagnosed"),
    ],
)
def test_shaders_by_their_source_are_told(source: str, authored: str) -> None:
    """Their id does not count then (UsdShadeNodeDefAPI)."""
    text = material("").replace(
        "uniform token info:id", f'uniform token info:implementationSource = "{source}"\n {authored}\n uniform token info:id'
    )
    made, found = surface_of(text)
    assert (made.lambert, [code for code, _ in found]) == (True, ["shader-ignored"])


@pytest.mark.conforms("NodeGraph.inputs:NAME", "NodeGraph.outputs:NAME", "Shader.inputs:NAME", "Shader.outputs:NAME")
@pytest.mark.conforms("ConnectableAPI.connections")
def test_values_and_nodes_reach_through_interfaces() -> None:
    """A constant of the material's interface through a node graph's, and a node inside the graph through its output."""
    graph = """
    def NodeGraph "g"
    {
        float inputs:rough.connect = </m.inputs:rough>
        float outputs:rough.connect = </m/g.inputs:rough>
        color3f outputs:color.connect = </m/g/r.outputs:result>
        def Shader "r"
        {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "tint"
            float3 outputs:result
        }
    }"""
    inputs = (
        "float inputs:roughness.connect = </m/g.outputs:rough>\n color3f inputs:diffuseColor.connect = </m/g.outputs:color>"
    )
    made, found = surface_of(material(inputs, graph, "float inputs:rough = 0.125"))
    assert (made.roughness, input_of(made), found) == (0.125, PrimvarInput("tint", (0, 0, 0)), [])


def textured(
    authored: str, image: str, connected: str = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>"
) -> Surface:
    nodes = READER + (IMAGE % image).replace("float2 inputs:st", f"{authored}\n        float2 inputs:st")
    made, found = surface_of(material(connected, nodes))
    assert found == []
    return made


NUMBERS = (0.5, 0.25, 0.125, 1)


@pytest.mark.parametrize(
    ("authored", "field", "expected"),
    [
        conforms("UsdUVTexture.inputs:wrapS", 'token inputs:wrapS = "clamp"', "wrap_s", Wrap.CLAMP),
        conforms("UsdUVTexture.inputs:wrapS", 'token inputs:wrapS = "mirror"', "wrap_s", Wrap.MIRROR),
        conforms("UsdUVTexture.inputs:wrapT", 'token inputs:wrapT = "repeat"', "wrap_t", Wrap.REPEAT),
        conforms("UsdUVTexture.inputs:wrapT", 'token inputs:wrapT = "black"', "wrap_t", Wrap.BLACK),
        conforms("UsdUVTexture.inputs:fallback", "float4 inputs:fallback = (0.5, 0.25, 0.125, 1)", "fallback", NUMBERS),
        conforms("UsdUVTexture.inputs:scale", "float4 inputs:scale = (0.5, 0.25, 0.125, 1)", "scale", NUMBERS),
        conforms("UsdUVTexture.inputs:bias", "float4 inputs:bias = (0.5, 0.25, 0.125, 1)", "bias", NUMBERS),
    ],
)
def test_parameters_of_textures(authored: str, field: str, expected: Any, image: str) -> None:
    assert getattr(texture(textured(authored, image)), field) == expected
    assert getattr(texture(textured("", image)), field) != expected


@pytest.mark.conforms("UsdUVTexture.inputs:file", "UsdUVTexture.inputs:st", "UsdUVTexture.outputs:rgb")
def test_a_textures_file_and_coordinates(image: str) -> None:
    made = texture(textured("", image))
    assert (made.file, made.channels, made.st) == (TextureFile(image, "auto"), "rgb", PrimvarInput("uv", (0, 0)))


@pytest.mark.parametrize("channel", [conforms(f"UsdUVTexture.outputs:{c}", c) for c in "rgba"])
def test_channels_of_textures(channel: str, image: str) -> None:
    made = textured("", image, f"float inputs:roughness.connect = </m/image.outputs:{channel}>")
    assert texture(made, "roughness").channels == channel


WIDTHS = {"float": 1, "float2": 2, "float3": 3, "float4": 4, "int": 1, "normal": 3, "point": 3, "vector": 3}
FALLBACKS = {1: "2", 2: "(1, 2)", 3: "(0.5, 0.25, 0.125)", 4: "(0.5, 0.25, 0.125, 1)"}


def read_by(kind: str, image: str, fallback: str = "") -> PrimvarInput:
    """What a reader of this kind gives to an input of its width; two numbers are texture coordinates."""
    width = WIDTHS[kind]
    authored = f'string inputs:varname = "p"\n {fallback}'
    reader = node("r", f"UsdPrimvarReader_{kind}", authored, "float outputs:result")
    if width == 2:
        image_node = (IMAGE % image).replace("/m/reader.", "/m/r.")
        made, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", reader + image_node))
        assert found == []
        return texture(made).st
    field, name = ("ior", "float inputs:ior") if width == 1 else ("diffuse_color", "color3f inputs:diffuseColor")
    made, found = surface_of(material(f"{name}.connect = </m/r.outputs:result>", reader))
    assert found == []
    read = input_of(made, field)
    assert isinstance(read, PrimvarInput)
    return read


def of_reader(kind: str) -> Any:
    rows = [f"UsdPrimvarReader_{kind}.{name}" for name in ("inputs:varname", "inputs:fallback", "outputs:result")]
    return pytest.param(kind, marks=pytest.mark.conforms(*rows), id=kind)


@pytest.mark.parametrize("kind", [of_reader(kind) for kind in WIDTHS])
def test_readers(kind: str, image: str) -> None:
    width = WIDTHS[kind]
    most = min(width, 3)  # of four numbers a colour takes three
    assert read_by(kind, image) == PrimvarInput("p", (0.0,) * most)
    usd_type = {"int": "int", "normal": "normal3f", "point": "point3f", "vector": "vector3f"}.get(kind, kind)
    found = read_by(kind, image, f"{usd_type} inputs:fallback = {FALLBACKS[width]}").fallback
    assert found == {1: (2,), 2: (1, 2), 3: (0.5, 0.25, 0.125)}[most]


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(
            kind,
            marks=pytest.mark.conforms(
                *(f"UsdPrimvarReader_{kind}.{name}" for name in ("inputs:varname", "inputs:fallback", "outputs:result")),
                state="diagnosed",
            ),
            id=kind,
        )
        for kind in ("string", "matrix")
    ],
)
def test_readers_of_what_is_no_colour(kind: str) -> None:
    """No input of UsdPreviewSurface takes a string or a matrix: connected to one, its default is used."""
    nodes = node("r", f"UsdPrimvarReader_{kind}", 'string inputs:varname = "p"')
    made, found = surface_of(material("float inputs:roughness.connect = </m/r.outputs:result>", nodes))
    assert (made.roughness, made.inputs) == (0.5, ())
    assert {code for code, _ in found} == {"connection-type", "material-input"}


@pytest.mark.parametrize(
    ("authored", "expected"),
    [
        conforms("UsdTransform2d.inputs:in", "", (1, 0, 0, 0, 1, 0)),
        conforms("UsdTransform2d.outputs:result", "", (1, 0, 0, 0, 1, 0)),
        conforms("UsdTransform2d.inputs:scale", "float2 inputs:scale = (2, 3)", (2, 0, 0, 0, 3, 0)),
        conforms("UsdTransform2d.inputs:rotation", "float inputs:rotation = 90", (0, -1, 0, 1, 0, 0)),
        conforms("UsdTransform2d.inputs:translation", "float2 inputs:translation = (2, 3)", (1, 0, 2, 0, 1, 3)),
    ],
)
def test_transforms(authored: str, expected: tuple[float, ...], image: str) -> None:
    transform = node("t", "UsdTransform2d", f"float2 inputs:in.connect = </m/reader.outputs:result>\n {authored}")
    nodes = READER + transform + (IMAGE % image).replace("/m/reader.", "/m/t.")
    made, found = surface_of(material("color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>", nodes))
    read = texture(made)
    assert isinstance(read, TextureInput)
    assert (read.st.name, found) == ("uv", [])
    assert read.st_transform == pytest.approx(expected, abs=1e-12)
