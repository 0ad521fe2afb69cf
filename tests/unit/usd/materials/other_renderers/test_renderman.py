"""RenderMan's shaders: each node's rule by the colour that it gives, surfaces by the lobes that they have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.unit.usd.known_surface_text import lobes
from tests.unit.usd.materials.other_renderers.shader_text import node, shader, stage, surface_of

from primray.description import PrimvarInput, TextureInput
from primray.description.shading import Surface

A, B = (0.2, 0.4, 0.6), (0.5, 0.25, 1.0)
RGB = f"color3f inputs:inputRGB = {A}\n"
LUMA = 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.6

# A node, its inputs, the output that is read, and the colour that it gives.
NODES: list[tuple[str, str, str, tuple[float, float, float]]] = [
    ("PxrMix", f"color3f inputs:color1 = {A}\n color3f inputs:color2 = {B}\n float inputs:mix = 0.25", "resultRGB",
     (0.275, 0.3625, 0.7)),
    ("PxrInvert", RGB, "resultRGB", (0.8, 0.6, 0.4)),
    ("PxrExposure", RGB + "float inputs:stops = -1", "resultRGB", (0.1, 0.2, 0.3)),
    ("PxrGamma", RGB + "float inputs:gamma = 0.5", "resultRGB", (0.04, 0.16, 0.36)),
    ("PxrHSL", RGB + "float inputs:saturation = 0\n float inputs:lightness = 2", "resultRGB", (2 * LUMA, 2 * LUMA, 2 * LUMA)),
    ("PxrColorCorrect", RGB + "color3f inputs:multiply = (2, 1, 1)\n float inputs:mask = 0.5", "resultRGB", (0.3, 0.4, 0.6)),
    ("PxrClamp", RGB + "color3f inputs:max = (0.1, 1, 0.5)", "resultRGB", (0.1, 0.4, 0.5)),
    ("PxrRemap", RGB + "float inputs:inputMax = 2\n float inputs:outputMin = 1\n float inputs:outputMax = 3", "resultRGB",
     (1.2, 1.4, 1.6)),
    ("PxrBlend", f"color3f inputs:topRGB = {A}\n color3f inputs:bottomRGB = {B}\n float inputs:topA = 0.5", "resultRGB",
     (0.35, 0.325, 0.8)),
    ("PxrBlend", f"color3f inputs:topRGB = {A}\n color3f inputs:bottomRGB = {B}\n int inputs:operation = 18", "resultRGB",
     (0.1, 0.1, 0.6)),
    ("PxrToFloat", f"color3f inputs:input = {A}\n int inputs:mode = 1", "resultF", (0.4, 0.4, 0.4)),
    ("PxrToFloat3", "float inputs:input = 0.5\n float inputs:inputG = 0.25", "resultRGB", (0.5, 0.25, 0.5)),
    ("PxrMix", f"color3f inputs:color1 = {A}", "resultB", (0.6, 0.6, 0.6)),
]  # fmt: skip


def says(*kinds: str, end: str = "") -> str:
    return f"RenderMan's shaders are translated by their documentation, not interpreted: {', '.join(kinds)}.{end}"


def made(surface: str, nodes: str = "") -> tuple[Surface, dict[str, list[str]]]:
    return surface_of(stage(surface, nodes, context="ri:"))


@pytest.mark.parametrize(
    ("kind", "inputs", "output", "expected"), NODES, ids=[f"{kind} {i}" for i, (kind, *_) in enumerate(NODES)]
)
def test_a_node_gives_the_colour_that_its_documentation_says(
    kind: str, inputs: str, output: str, expected: tuple[float, float, float]
) -> None:
    fed = f"color3f inputs:emitColor.connect = </m/n.outputs:{output}>"
    surface, told = made(shader("PxrConstant", fed), node("n", kind, inputs, f"color3f outputs:{output}"))
    assert surface.emissive_color == pytest.approx(expected, abs=1e-6)
    assert told["translated"] == [says("PxrConstant", kind)]


DISNEY = {"specular_roughness": 0.25, "specular_ior": 1.5}
# A surface, its inputs, what differs from OpenPBR's defaults, and what its message has at its end.
SURFACES: dict[str, tuple[str, str, dict[str, Any], str]] = {
    "PxrSurface's defaults": (
        "PxrSurface",
        "",
        {"base_color": (0.18, 0.18, 0.18), "specular_weight": 0.0, "specular_roughness": 0.2},
        "",
    ),
    "PxrSurface as plastic": (
        "PxrSurface",
        "color3f inputs:diffuseColor = (0.8, 0.4, 0)\n float inputs:diffuseGain = 0.5\n"
        "color3f inputs:specularFaceColor = (0.04, 0.04, 0.04)\n color3f inputs:specularEdgeColor = (1, 1, 1)\n"
        "float inputs:specularRoughness = 0.4\n int inputs:specularModelType = 1",
        {"base_color": (0.4, 0.2, 0.0), "specular_ior": 1.5, "specular_roughness": 0.4},
        "",
    ),
    "PxrSurface as a metal": (
        "PxrSurface",
        "float inputs:diffuseGain = 0\n color3f inputs:specularFaceColor = (1, 0.8, 0.3)\n"
        "color3f inputs:specularEdgeColor = (1, 1, 1)",
        {"base_color": (1.0, 0.8, 0.3), "base_metalness": 1.0, "specular_roughness": 0.2, "specular_ior": 1.788854},
        " Approximated: specularFaceColor.",
    ),
    "PxrSurface by an index": (
        "PxrSurface",
        "int inputs:specularFresnelMode = 1\n color3f inputs:specularEdgeColor = (1, 1, 1)\n"
        "color3f inputs:specularIor = (1.5, 1.5, 1.5)",
        {"base_color": (0.18, 0.18, 0.18), "specular_roughness": 0.2, "specular_ior": 1.5},
        "",
    ),
    "PxrSurface as glass": (
        "PxrSurface",
        "float inputs:diffuseGain = 0\n float inputs:refractionGain = 1\n float inputs:glassIor = 1.4\n"
        "float inputs:glassRoughness = 0",
        {"base_color": (0.0, 0.0, 0.0), "transmission_weight": 1.0, "specular_ior": 1.4, "specular_roughness": 0.0},
        " Approximated: refractionGain.",
    ),
    "PxrSurface with other lobes": (
        "PxrSurface",
        "color3f inputs:roughSpecularFaceColor = (1, 1, 1)\n float inputs:roughSpecularRoughness = 0.4\n"
        "float inputs:iridescenceFaceGain = 0\n float inputs:fuzzConeAngle = 4",
        {"base_color": (0.18, 0.18, 0.18), "specular_weight": 0.0, "specular_roughness": 0.2},
        " Not supported, or only in part: roughSpecularFaceColor.",
    ),
    "PxrDisneyBsdf": (
        "PxrDisneyBsdf",
        "color3f inputs:baseColor = (1, 0.5, 0)\n float inputs:metallic = 1\n float inputs:roughness = 0.5",
        {"base_color": (1.0, 0.5, 0.0), "base_metalness": 1.0, "specular_roughness": 0.5, "specular_ior": 1.5},
        "",
    ),
    "PxrDisney": (
        "PxrDisney",
        "color3f inputs:baseColor = (1, 0.5, 0)\n float inputs:specular = 0.5",
        {"base_color": (1.0, 0.5, 0.0), **DISNEY},
        " Approximated: roughness.",
    ),
    "PxrDiffuse": (
        "PxrDiffuse",
        "color3f inputs:diffuseColor = (1, 0.5, 0)",
        {"base_color": (1.0, 0.5, 0.0), "specular_weight": 0.0},
        "",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "inputs", "expected", "end"), SURFACES.values(), ids=SURFACES)
def test_a_surface_has_its_lobes(kind: str, inputs: str, expected: dict[str, Any], end: str) -> None:
    surface, told = made(shader(kind, inputs))
    found = {name: value for name, value in lobes(surface).items() if not name.startswith(("fuzz", "coat", "subsurface_"))}
    assert found == {name: pytest.approx(value, rel=1e-4, abs=1e-6) for name, value in expected.items()}
    assert told["translated"] == [says(kind, end=end)]


def test_an_occluding_presence_and_a_glow() -> None:
    surface, _ = made(
        shader("PxrSurface", "float inputs:presence = 0.5\n float inputs:glowGain = 2\n color3f inputs:glowColor = (1, 0, 0)")
    )
    assert surface.presence
    assert surface.opacity == 0.5
    assert surface.emissive_color == (2.0, 0.0, 0.0)


def textured(inputs: str, tmp_path: Path, nodes: str = "") -> TextureInput:
    file = tmp_path / "t.tex"
    file.write_bytes(b"")
    text = node("n", "PxrTexture", f"asset inputs:filename = @{file}@\n{inputs}", "color3f outputs:resultRGB") + nodes
    surface, _ = made(shader("PxrDisneyBsdf", "color3f inputs:baseColor.connect = </m/n.outputs:resultRGB>"), text)
    found = dict(surface.inputs)["open_pbr_base_color"]
    assert isinstance(found, TextureInput), found
    return found


@pytest.mark.parametrize(("inputs", "space"), [("", "raw"), ("int inputs:linearize = 1", "sRGB")])
def test_linearize_says_the_space_of_a_texture(inputs: str, space: str, tmp_path: Path) -> None:
    assert textured(inputs, tmp_path).file.color_space == space


MANIFOLD = node(
    "p",
    "PxrManifold2D",
    'string inputs:primvarS = "map1"\n string inputs:primvarT = "map1"\n float inputs:scaleS = 2\n float inputs:offsetT = 0.5',
    "token outputs:result",
)
PLACED = "token inputs:manifold.connect = </m/p.outputs:result>\n"


@pytest.mark.parametrize(
    ("inputs", "name", "affine"),
    [
        ("", "st", (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)),
        ("int inputs:invertT = 0", "st", (1.0, 0.0, 0.0, 0.0, -1.0, 1.0)),
        (PLACED, "map1", (2.0, 0.0, 0.0, 0.0, 1.0, 0.5)),
        (PLACED + "int inputs:invertT = 0", "map1", (2.0, 0.0, 0.0, 0.0, 1.0, 0.5)),
    ],
)
def test_where_a_texture_is_looked_up(inputs: str, name: str, affine: tuple[float, ...], tmp_path: Path) -> None:
    found = textured(inputs, tmp_path, MANIFOLD)
    assert found.st.name == name
    assert found.st_transform == pytest.approx(affine)


def test_a_primvar_is_read_by_its_name_and_type() -> None:
    data = node("n", "PxrPrimvar", 'string inputs:varname = "tint"\n string inputs:type = "color"', "color3f outputs:resultRGB")
    surface, _ = made(shader("PxrDisneyBsdf", "color3f inputs:baseColor.connect = </m/n.outputs:resultRGB>"), data)
    assert dict(surface.inputs)["open_pbr_base_color"] == PrimvarInput("tint", (0.0, 0.0, 0.0))


@pytest.mark.parametrize(("inputs", "green"), [("", 2.0), ("int inputs:orientation = 1", -2.0), ("int inputs:flipY = 1", -2.0)])
def test_a_normal_map_is_in_the_tangents_frame(inputs: str, green: float, tmp_path: Path) -> None:
    file = tmp_path / "n.tex"
    file.write_bytes(b"")
    text = node("n", "PxrNormalMap", f"asset inputs:filename = @{file}@\n{inputs}", "normal3f outputs:resultN")
    surface, _ = made(shader("PxrSurface", "normal3f inputs:bumpNormal.connect = </m/n.outputs:resultN>"), text)
    found = dict(surface.inputs)["normal"]
    assert isinstance(found, TextureInput)
    assert found.scale[:3] == (2.0, green, 2.0)
    assert found.file.color_space == "raw"


def test_houdinis_versions_of_nodes_are_the_same() -> None:
    surface, told = made(shader("PxrDiffuse::3.0", "color3f inputs:diffuseColor = (1, 0, 0)"))
    assert lobes(surface)["base_color"] == (1.0, 0.0, 0.0)
    assert told["translated"] == [says("PxrDiffuse")]
