"""A node means the same whatever surface it feeds: UsdPreviewSurface, surface_unlit and OpenPBR read each network alike."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.unit.usd.material_text import material, node, surface_of

from primray.description import Pattern, Surface, TextureInput, Wrap
from primray.usd.materials.materialx.definitions import Definition, definition
from primray.usd.materials.materialx.documents import library
from primray.usd.materials.usd_nodes import USD_NODES

SURFACES = {
    "UsdPreviewSurface": "color3f inputs:emissiveColor.connect = {}\n",
    "ND_UsdPreviewSurface_surfaceshader": "color3f inputs:emissiveColor.connect = {}\n",
    "ND_surface_unlit": "color3f inputs:emission_color.connect = {}\n",
    "ND_open_pbr_surface_surfaceshader": "float inputs:emission_luminance = 1\n color3f inputs:emission_color.connect = {}\n",
}
_TYPES = {"float": "float", "integer": "int", "boolean": "bool", "string": "string", "filename": "asset"}
_TYPES |= {"vector2": "float2", "vector3": "float3", "vector4": "float4", "color3": "color3f", "color4": "color4f"}
_TYPES |= {"matrix33": "matrix3d", "matrix44": "matrix4d"}
# A value of each type that is no input's default; texts that are names of something need such a name.
_OTHERS = {"float": "0.375", "integer": "3", "vector2": "(0.375, 0.625)", "vector3": "(0.375, 0.625, 0.5)"}
_OTHERS |= {"vector4": "(0.375, 0.625, 0.5, 0.25)", "color3": "(0.375, 0.625, 0.5)", "color4": "(0.375, 0.625, 0.5, 0.25)"}
_TEXTS = {
    "filtertype": "closest", "framerange": "1-2", "frameendaction": "mirror", "wrapS": "mirror", "wrapT": "clamp",
    "uaddressmode": "mirror", "vaddressmode": "clamp", "space": "world", "geomprop": "p", "varname": "p", "layer": "l",
    "sourceColorSpace": "raw",
}  # fmt: skip


def described(nodes: str, source: str) -> list[tuple[object, ...]]:
    """By surface: its emission as a constant and as what varies, with the pattern, and what is reported."""
    made = []
    for shader, inputs in SURFACES.items():
        surface, found = surface_of(material(inputs.format(f"</m/{source}>"), nodes, shader=shader))
        made.append((*emission(surface), sorted({code for code, path in found if path != "/m/s"})))
    return made


def emission(surface: Surface) -> tuple[object, ...]:
    varying = dict(surface.inputs).get("emissive_color")
    return surface.emissive_color, varying, surface.pattern


def told_apart(found: list[tuple[object, ...]]) -> list[object]:
    return [other for other in found[1:] if other != found[0]]


CHAINS = {
    "repeated outside": "",
    "default outside": 'string inputs:uaddressmode = "constant"\n color3f inputs:default = (1, 0.5, 0)',
    "closest": 'string inputs:filtertype = "closest"',
    "layer": 'string inputs:layer = "diff"',
}
COORDINATES = {
    "texcoord": node("c", "ND_texcoord_vector2", "int inputs:index = 1", "float2 outputs:out"),
    "primvar": node("c", "ND_geompropvalue_vector2", 'string inputs:geomprop = "uv"', "float2 outputs:out"),
    "reader": node("c", "ND_UsdPrimvarReader_vector2", 'string inputs:varname = "uv"', "float2 outputs:out"),
    "placed": node("c", "ND_place2d_vector2", "float2 inputs:scale = (2, 4)\n float inputs:rotate = 30", "float2 outputs:out"),
    "moved": node("c", "ND_UsdTransform2d", "float inputs:rotation = 30\n float2 inputs:in = (1, 2)", "float2 outputs:out"),
    "varying": node("c", "ND_position_vector3", "", "float3 outputs:out").replace('"c"', '"p"')
    + node("c", "ND_convert_vector3_vector2", "float3 inputs:in.connect = </m/p.outputs:out>", "float2 outputs:out"),
}


@pytest.mark.parametrize("coordinates", COORDINATES)
@pytest.mark.parametrize("chain", CHAINS)
def test_images(chain: str, coordinates: str, image: str) -> None:
    inputs = f"asset inputs:file = @{image}@\n float2 inputs:texcoord.connect = </m/c.outputs:out>\n {CHAINS[chain]}"
    nodes = COORDINATES[coordinates] + node("n", "ND_image_color3", inputs, "color3f outputs:out")
    assert told_apart(described(nodes, "n.outputs:out")) == []


@pytest.mark.parametrize("kind", ["UsdUVTexture", "ND_UsdUVTexture", "ND_UsdUVTexture_23"])
@pytest.mark.parametrize("output", ["rgb", "r", "a"])
@pytest.mark.parametrize("coordinates", COORDINATES)
def test_usds_textures(kind: str, output: str, coordinates: str, image: str) -> None:
    inputs = f"asset inputs:file = @{image}@\n float2 inputs:st.connect = </m/c.outputs:out>\n"
    inputs += "float4 inputs:scale = (2, 3, 4, 5)\n float4 inputs:bias = (0.5, 0, 0, 0.25)\n token inputs:wrapT = 'clamp'"
    nodes = COORDINATES[coordinates] + node("n", kind, inputs, f"float3 outputs:{output}")
    found = described(nodes, f"n.outputs:{output}")
    assert told_apart(found) == []
    assert isinstance(found[0][1], TextureInput) or isinstance(found[0][2], Pattern)


def test_wraps_are_those_of_the_nodes_own_definition(image: str) -> None:
    """USD's is black unless the file says otherwise, MaterialX's repeats, and reads UV0 without being told."""
    for kind, wrap, primvar in (("UsdUVTexture", Wrap.USE_METADATA, ""), ("ND_UsdUVTexture_23", Wrap.REPEAT, "st")):
        nodes = node("n", kind, f"asset inputs:file = @{image}@", "float3 outputs:rgb")
        for _, made, _, _ in described(nodes, "n.outputs:rgb"):
            assert isinstance(made, TextureInput)
            assert (made.wrap_s, made.wrap_t, made.st.name) == (wrap, wrap, primvar)


def _definitions() -> Iterator[str]:
    """Of nodes that feed a colour, and for which a network can be written down. A reader of one number feeds none:
    the surface's own default is used."""
    for found in library().getNodeDefs():
        made = USD_NODES.get(found.getName()) or definition(found.getName())
        narrow = made is not None and made.category == "UsdPrimvarReader" and made.width == 1
        if made and made.width in (1, 3, 4) and not narrow and all(i.type in _TYPES for i in made.inputs):
            yield made.name


def _other(found: Definition, name: str, kind: str, image: str) -> str:
    default = found.defaults.get(name)
    if kind == "filename":
        return f"@{image}@"
    if kind == "string":
        return f'"{_TEXTS.get(name, "other")}"'
    if kind == "boolean":
        return "0" if default == (1.0,) else "1"
    if kind.startswith("matrix"):
        n = 3 if kind == "matrix33" else 4
        return "(" + ", ".join("(" + ", ".join("2" if r == c else "0" for c in range(n)) + ")" for r in range(n)) + ")"
    if kind == "integer":
        return "2" if default == (1.0,) else "1"
    return _OTHERS[kind]


def _authored(found: Definition, changed: str, image: str) -> str:
    lines = []
    for wanted in found.inputs:
        if wanted.name == changed or wanted.type == "filename" or wanted.name in ("geomprop", "varname"):
            value = _other(found, wanted.name, wanted.type, image)
            lines.append(f"{_TYPES[wanted.type]} inputs:{wanted.name} = {value}")
    return "\n".join(lines)


@pytest.mark.parametrize("name", sorted(_definitions()))
def test_each_node_of_the_library_means_the_same(name: str, image: str) -> None:
    """With its files and names of primvars alone."""
    found = USD_NODES.get(name) or definition(name)
    assert found is not None
    output, kind = found.outputs[0]
    nodes = node("n", name, _authored(found, "", image), f"{_TYPES[kind]} outputs:{output}")
    assert told_apart(described(nodes, f"n.outputs:{output}")) == []
