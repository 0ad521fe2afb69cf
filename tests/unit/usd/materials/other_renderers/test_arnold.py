"""Arnold's shaders: each node's rule by the colour that it gives, surfaces by the lobes that they have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.unit.usd.known_surface_text import close, lobes
from tests.unit.usd.materials.other_renderers.shader_text import node, shader, stage, surface_of

from primray.description import PatternInput, PrimvarInput, TextureInput
from primray.description.shading import Surface

A, B = (0.2, 0.4, 0.6), (0.5, 0.25, 1.0)
COLORS = f"color3f inputs:input1 = {A}\n color3f inputs:input2 = {B}\n"
INPUT = f"color3f inputs:input = {A}\n"
LUMA = 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.6

# A node, its inputs, and the colour that it gives.
NODES: list[tuple[str, str, tuple[float, float, float]]] = [
    ("add", COLORS, (0.7, 0.65, 1.6)),
    ("subtract", COLORS, (-0.3, 0.15, -0.4)),
    ("multiply", COLORS, (0.1, 0.1, 0.6)),
    ("multiply", f"color3f inputs:input1 = {A}", A),
    ("divide", COLORS, (0.4, 1.6, 0.6)),
    ("min", COLORS, (0.2, 0.25, 0.6)),
    ("max", COLORS, (0.5, 0.4, 1.0)),
    ("pow", f"color3f inputs:base = {A}\n color3f inputs:exponent = (2, 1, 0.5)", (0.04, 0.4, 0.6**0.5)),
    ("modulo", "color3f inputs:input = (1.25, 0.5, 2)\n color3f inputs:divisor = (1, 1, 1.5)", (0.25, 0.5, 0.5)),
    ("abs", "color3f inputs:input = (-0.5, 0.5, 0)", (0.5, 0.5, 0.0)),
    ("negate", "color3f inputs:input = (-0.5, 0.5, 0)", (0.5, -0.5, 0.0)),
    ("complement", INPUT, (0.8, 0.6, 0.4)),
    ("sqrt", "color3f inputs:input = (0.25, 1, 0)", (0.5, 1.0, 0.0)),
    ("reciprocal", "color3f inputs:input = (0.5, 1, 4)", (2.0, 1.0, 0.25)),
    ("clamp", "color3f inputs:input = (2, -1, 0.5)", (1.0, 0.0, 0.5)),
    ("clamp", 'color3f inputs:input = (2, -1, 0.5)\n string inputs:mode = "color"\n color3f inputs:max_color = (1, 1, 0.25)',
     (1.0, 0.0, 0.25)),
    ("mix_rgba", COLORS + "float inputs:mix = 0.25", (0.275, 0.3625, 0.7)),
    ("mix_rgba", COLORS, (0.35, 0.325, 0.8)),
    ("color_correct", INPUT + "float inputs:exposure = 1\n color3f inputs:multiply = (1, 0.5, 1)", (0.4, 0.4, 1.2)),
    ("color_correct", INPUT + "float inputs:saturation = 0", (LUMA, LUMA, LUMA)),
    ("color_correct", INPUT + "float inputs:contrast = 2\n float inputs:contrast_pivot = 0.4", (0.0, 0.4, 0.8)),
    ("color_correct", INPUT + "float inputs:gamma = 0.5\n float inputs:mask = 0.5", (0.12, 0.28, 0.48)),
    ("color_correct", INPUT + "bool inputs:invert = 1\n color3f inputs:add = (0.1, 0, 0)", (0.7, 0.6, 0.4)),
    ("range", INPUT + "float inputs:input_max = 2\n float inputs:output_min = 1\n float inputs:output_max = 3",
     (1.2, 1.4, 1.6)),
    ("layer_rgba", COLORS + "float inputs:mix1 = 0.5", (0.35, 0.325, 0.8)),
    ("layer_rgba", COLORS + 'string inputs:operation1 = "multiply"', (0.1, 0.1, 0.6)),
    ("switch_rgba", "int inputs:index = 2\n color3f inputs:input2 = (1, 2, 3)", (1.0, 2.0, 3.0)),
    ("shuffle", f'color3f inputs:color = {A}\n string inputs:channel_r = "b"\n bool inputs:negate_g = 1', (0.6, 0.6, 0.6)),
    ("float_to_rgb", "float inputs:r = 0.1\n float inputs:b = 0.3", (0.1, 0.0, 0.3)),
    ("rgb_to_float", INPUT, (0.4, 0.4, 0.4)),
    ("rgb_to_float", INPUT + 'string inputs:mode = "max"', (0.6, 0.6, 0.6)),
    ("rgb_to_float", INPUT + "int inputs:mode = 4", (LUMA, LUMA, LUMA)),
    ("color_convert", 'color3f inputs:input = (0, 1, 0.5)\n string inputs:from = "HSV"', (0.5, 0.0, 0.0)),
    ("compare", 'string inputs:test = ">"\n float inputs:input1 = 2\n float inputs:input2 = 1', (1.0, 1.0, 1.0)),
    ("compare", 'string inputs:test = "<"\n float inputs:input1 = 2\n float inputs:input2 = 1', (0.0, 0.0, 0.0)),
    ("dot", "vector3f inputs:input1 = (1, 2, 3)\n vector3f inputs:input2 = (1, 1, 0)", (3.0, 3.0, 3.0)),
    ("length", "vector3f inputs:input = (3, 4, 0)", (5.0, 5.0, 5.0)),
    ("trigo", 'color3f inputs:input = (0, 0, 0)\n string inputs:function = "cos"', (1.0, 1.0, 1.0)),
    ("flat", f"color4f inputs:color = {(*A, 1.0)}", A),
    ("aov_write_rgb", f'string inputs:aov_name = "a"\n color3f inputs:passthrough = {A}', A),
    ("ramp_rgb", "float inputs:input = 0.75\n float[] inputs:position = [0, 0.5, 1]\n"
     "color3f[] inputs:color = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]", (0.0, 0.5, 0.5)),
    ("ramp_rgb", "float inputs:input = 0.75\n float[] inputs:position = [0.5, 0, 1]\n int[] inputs:interpolation = [0]\n"
     "color3f[] inputs:color = [(0, 1, 0), (1, 0, 0), (0, 0, 1)]", (0.0, 1.0, 0.0)),
    ("ramp_float", "float inputs:input = 0.25\n float[] inputs:position = [0, 1]\n float[] inputs:value = [2, 4]",
     (2.5, 2.5, 2.5)),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "inputs", "expected"), NODES, ids=[f"{kind} {i}" for i, (kind, *_) in enumerate(NODES)])
def test_a_node_gives_the_colour_that_its_documentation_says(
    kind: str, inputs: str, expected: tuple[float, float, float]
) -> None:
    surface, told = emitting(node("n", f"arnold:{kind}", inputs))
    # Light is at least 0, which is the surface's own limit.
    assert surface.emissive_color == pytest.approx(tuple(max(x, 0.0) for x in expected), abs=1e-6)
    assert told["translated"] == [says("standard_surface", kind)]


def says(*kinds: str, end: str = "") -> str:
    return f"Arnold's shaders are translated by their documentation, not interpreted: {', '.join(kinds)}.{end}"


def emitting(nodes: str, output: str = "out") -> tuple[Surface, dict[str, list[str]]]:
    fed = f"float inputs:emission = 1\n color3f inputs:emission_color.connect = </m/n.outputs:{output}>"
    return surface_of(stage(shader("arnold:standard_surface", fed), nodes))


def test_standard_surface_is_materialx_own() -> None:
    inputs = (
        "float inputs:base = 0.5\n color3f inputs:base_color = (1, 0.5, 0)\n float inputs:metalness = 0.25\n"
        "float inputs:specular_roughness = 0.4\n float inputs:coat = 1\n color3f inputs:coat_color = (1, 0.5, 1)\n"
        "float inputs:sheen = 0.5\n float inputs:subsurface = 0.5\n float inputs:transmission = 0.25\n"
        "float inputs:specular_anisotropy = 0.5\n color3f inputs:opacity = (0.5, 0.5, 0.5)\n bool inputs:thin_walled = 1"
    )
    arnold, told = surface_of(stage(shader("arnold:standard_surface", inputs)))
    same, _ = surface_of(stage(shader("ND_standard_surface_surfaceshader", inputs), context="mtlx:"))
    assert arnold == same
    assert len(told["translated"]) == 1
    assert "Approximated: " in told["translated"][0]


def test_openpbr_surface_is_materialx_own() -> None:
    inputs = "color3f inputs:base_color = (1, 0.5, 0)\n float inputs:coat_weight = 0.5\n float inputs:fuzz_weight = 0.25"
    arnold, _ = surface_of(stage(shader("arnold:openpbr_surface", inputs)))
    same, _ = surface_of(stage(shader("ND_open_pbr_surface_surfaceshader", inputs), context="mtlx:"))
    assert arnold == same


# A surface, its inputs, what differs from OpenPBR's defaults, and what it shines with.
SURFACES: dict[str, tuple[str, str, dict[str, Any], tuple[float, float, float]]] = {
    "lambert": (
        "lambert",
        "float inputs:Kd = 0.5\n color3f inputs:Kd_color = (1, 0.5, 0)",
        {"base_weight": 0.5, "base_color": (1.0, 0.5, 0.0), "specular_weight": 0.0},
        (0.0, 0.0, 0.0),
    ),
    "lambert's defaults": (
        "lambert",
        "",
        {"base_weight": 0.7, "base_color": (1.0, 1.0, 1.0), "specular_weight": 0.0},
        (0.0, 0.0, 0.0),
    ),
    "standard": (
        "standard",
        "float inputs:emission = 2\n color3f inputs:emission_color = (1, 0.5, 0)",
        {"base_weight": 0.7, "base_color": (1.0, 1.0, 1.0), "specular_weight": 0.0, "specular_roughness": 0.466905},
        (2.0, 1.0, 0.0),
    ),
}


@pytest.mark.parametrize(("kind", "inputs", "expected", "light"), SURFACES.values(), ids=SURFACES)
def test_a_surface_has_its_lobes(kind: str, inputs: str, expected: dict[str, Any], light: tuple[float, ...]) -> None:
    surface, _ = surface_of(stage(shader(f"arnold:{kind}", inputs)))
    assert lobes(surface) == close(expected)
    assert surface.emissive_color == pytest.approx(light)


@pytest.mark.parametrize(("kind", "inputs"), [("flat", "color3f inputs:color = (0.5, 0.25, 1)"), ("add", COLORS)])
def test_a_colour_that_is_bound_as_a_surface_shines_with_it(kind: str, inputs: str) -> None:
    surface, _ = surface_of(stage(shader(f"arnold:{kind}", inputs)))
    assert surface.lambert
    assert surface.open_pbr is None
    assert surface.emissive_color == pytest.approx((0.5, 0.25, 1.0) if kind == "flat" else (0.7, 0.65, 1.6))


def test_shaders_that_choose_or_mix_shaders() -> None:
    two = node("a", "arnold:lambert", "float inputs:Kd = 0.2") + node("b", "arnold:lambert", "float inputs:Kd = 0.6")
    both = "token inputs:shader1.connect = </m/a.outputs:out>\n token inputs:shader2.connect = </m/b.outputs:out>"
    mixed, told = surface_of(stage(shader("arnold:mix_shader", f"{both}\n float inputs:mix = 0.25"), two))
    assert lobes(mixed)["base_weight"] == pytest.approx(0.3)
    assert told["translated"] == [says("mix_shader", "lambert", end=" Approximated: mix.")]
    sides = "token inputs:front.connect = </m/a.outputs:out>\n token inputs:back.connect = </m/b.outputs:out>"
    front, told = surface_of(stage(shader("arnold:two_sided", sides), two))
    assert lobes(front)["base_weight"] == pytest.approx(0.2)
    assert told["translated"] == [says("two_sided", "lambert", end=" Not supported, or only in part: back.")]


def test_a_shader_that_leads_back_to_itself_is_no_surface() -> None:
    looped = "token inputs:front.connect = </m/s.outputs:out>"
    surface, told = surface_of(stage(shader("arnold:two_sided", looped)))
    assert surface.lambert
    assert "shader-ignored" in told


def test_channels_and_components_are_read_one_by_one() -> None:
    source = node("n", "arnold:flat", f"color3f inputs:color = {A}", "float outputs:b\n float outputs:a")
    fed = (
        "float inputs:metalness.connect = </m/n.outputs:b>\n color3f inputs:base_color = (0.1, 0.2, 0.3)\n"
        "float inputs:base_color:g.connect = </m/n.outputs:a>"
    )
    surface, _ = surface_of(stage(shader("arnold:standard_surface", fed), source))
    assert lobes(surface)["base_metalness"] == pytest.approx(0.6)
    assert lobes(surface)["base_color"] == pytest.approx((0.1, 1.0, 0.3))


def textured(inputs: str, tmp_path: Path, extension: str = "png") -> TextureInput:
    file = tmp_path / f"t.{extension}"
    file.write_bytes(b"")
    text = node("n", "arnold:image", f"asset inputs:filename = @{file}@\n{inputs}")
    surface, _ = surface_of(
        stage(shader("arnold:standard_surface", "color3f inputs:base_color.connect = </m/n.outputs:out>"), text)
    )
    made = dict(surface.inputs)["open_pbr_base_color"]
    assert isinstance(made, TextureInput), made
    return made


@pytest.mark.parametrize(
    ("inputs", "extension", "space"),
    [
        ("", "png", "sRGB"),
        ("", "exr", "raw"),
        ("", "tx", "auto"),
        ('string inputs:color_space = "auto"', "jpg", "sRGB"),
        ('string inputs:color_space = "linear"', "png", "raw"),
        ('string inputs:color_space = "Raw"', "png", "raw"),
        ('string inputs:color_space = "sRGB"', "exr", "sRGB"),
    ],
)
def test_the_space_of_an_image(inputs: str, extension: str, space: str, tmp_path: Path) -> None:
    assert textured(inputs, tmp_path, extension).file.color_space == space


def test_where_an_image_is_looked_up(tmp_path: Path) -> None:
    plain = textured("", tmp_path)
    assert (plain.wrap_s.value, plain.wrap_t.value, plain.st.name) == ("repeat", "repeat", "st")
    placed = textured(
        'string inputs:uvset = "map1"\n string inputs:swrap = "clamp"\n int inputs:twrap = 1\n'
        "float inputs:sscale = 2\n float inputs:soffset = 0.25\n bool inputs:tflip = 1\n"
        "color3f inputs:multiply = (0.5, 0.5, 0.5)\n color3f inputs:offset = (0.1, 0, 0)",
        tmp_path,
    )
    assert placed.st.name == "map1"
    assert (placed.wrap_s.value, placed.wrap_t.value) == ("clamp", "black")
    assert placed.st_transform == pytest.approx((2.0, 0.0, 0.25, 0.0, -1.0, 1.0))
    assert placed.scale[:3] == (0.5, 0.5, 0.5)
    assert placed.bias[:3] == pytest.approx((0.1, 0.0, 0.0))


def test_user_data_is_a_primvar() -> None:
    data = node("n", "arnold:user_data_rgb", 'string inputs:attribute = "tint"\n color3f inputs:default = (1, 0.5, 0)')
    surface, _ = surface_of(
        stage(shader("arnold:standard_surface", "color3f inputs:base_color.connect = </m/n.outputs:out>"), data)
    )
    assert dict(surface.inputs)["open_pbr_base_color"] == PrimvarInput("tint", (1.0, 0.5, 0.0))


def test_a_normal_map_is_in_the_tangents_frame(tmp_path: Path) -> None:
    file = tmp_path / "n.png"
    file.write_bytes(b"")
    nodes = node("i", "arnold:image", f'asset inputs:filename = @{file}@\n string inputs:color_space = "raw"') + node(
        "n", "arnold:normal_map", "color3f inputs:input.connect = </m/i.outputs:out>\n float inputs:strength = 0.5"
    )
    surface, _ = surface_of(
        stage(shader("arnold:standard_surface", "vector3f inputs:normal.connect = </m/n.outputs:out>"), nodes)
    )
    made = dict(surface.inputs)["normal"]
    assert isinstance(made, TextureInput)
    assert made.scale[:3] == (1.0, 1.0, 2.0)
    assert made.bias[:3] == (-0.5, -0.5, -1.0)


def test_a_bump_is_a_pattern_of_slopes(tmp_path: Path) -> None:
    file = tmp_path / "n.png"
    file.write_bytes(b"")
    nodes = node("i", "arnold:image", f"asset inputs:filename = @{file}@", "float outputs:r") + node(
        "n", "arnold:bump2d", "float inputs:bump_map.connect = </m/i.outputs:r>"
    )
    surface, told = surface_of(
        stage(shader("arnold:standard_surface", "vector3f inputs:normal.connect = </m/n.outputs:out>"), nodes)
    )
    assert isinstance(dict(surface.inputs)["normal"], PatternInput)
    assert surface.pattern is not None
    assert [n.category for n in surface.pattern.nodes][-2:] == ["heighttonormal", "normalmap"]
    assert told["translated"] == [says("standard_surface", "bump2d", "image", end=" Approximated: n.bump_height.")]


def test_what_has_no_effect_is_named_with_its_node() -> None:
    inputs = f'{INPUT} float inputs:bias = 0.75\n string inputs:name = "x"\n int inputs:foreign = 1'
    _, told = emitting(node("n", "arnold:range", inputs))
    assert told["translated"] == [
        says("standard_surface", "range", end=" Not supported, or only in part: n.bias, n.foreign, n.gain.")
    ]


def test_a_node_that_nobody_knows_leaves_a_default() -> None:
    _, told = emitting(node("n", "arnold:cell_noise"))
    assert told["shader-ignored"] == [
        "emission_color is connected to arnold:cell_noise, which is not supported: its default is used."
    ]
