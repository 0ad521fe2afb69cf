"""Networks of MaterialX's nodes: constants fold, images stay textures, and what is more is a pattern."""

from __future__ import annotations

import pytest
from tests.unit.usd.material_text import material, surface_of

from primray.description import NodeOutput, Pattern, PatternInput, PrimvarInput, Surface, TextureInput, Wrap

STANDARD = "ND_standard_surface_surfaceshader"


def node(name: str, kind: str, inputs: str = "", output: str = "color3f outputs:out") -> str:
    return f'def Shader "{name}" {{\n uniform token info:id = "{kind}"\n {inputs}\n {output}\n}}\n'


def fed(nodes: str, name: str = "base_color", kind: str = "color3f", source: str = "n", more: str = "") -> Surface:
    inputs = f"{kind} inputs:{name}.connect = </m/{source}.outputs:out>\n float inputs:base = 1\n {more}"
    surface, told = surface_of(material(inputs, nodes, shader=STANDARD))
    assert told == []
    return surface


def varying(surface: Surface, name: str = "open_pbr_base_color") -> object:
    return dict(surface.inputs)[name]


def given(*lines: str) -> str:
    """Inputs, each as "type name = value" or "type name < source"."""
    texts = [line.replace(" ", " inputs:", 1).replace(" < ", ".connect = </m/").strip() for line in lines]
    return "\n".join(f"{text}.outputs:out>" if "connect" in text else text for text in texts)


SUM = node("f", "ND_add_float", given("float in1 = 0.25", "float in2 = 0.5"), "float outputs:out")
TWO = ("color3f in1 = (1, 0, 0)", "color3f in2 = (0, 1, 0)", "color3f in3 = (0, 0, 1)")
CONSTANTS = {
    "multiply": (
        node("n", "ND_multiply_color3FA", given("color3f in1 = (0.5, 0.25, 1)", "float in2 = 0.5")),
        (0.25, 0.125, 0.5),
    ),
    "mix": (
        node("n", "ND_mix_color3", given("color3f fg = (1, 0, 0)", "color3f bg = (0, 1, 0)", "float mix = 0.25")),
        (0.25, 0.75, 0.0),
    ),
    "a library's graph": (
        node("n", "ND_contrast_color3", given("color3f in = (0.5, 0.75, 1)", "color3f amount = (0.5, 0.5, 0.5)")),
        (0.5, 0.625, 0.75),
    ),
    "a choice": (
        node("n", "ND_ifgreater_color3", given("float value1 = 2", "float value2 = 1", *TWO[:2])),
        (1.0, 0.0, 0.0),
    ),
    "a switch": (node("n", "ND_switch_color3", given(*TWO, "float which = 2")), (0.0, 0.0, 1.0)),
    "a chain": (node("n", "ND_convert_float_color3", given("float in < f")) + SUM, (0.75,) * 3),
    "a float as a colour": (SUM.replace('"f"', '"n"'), (0.75,) * 3),
    "an image without a file": (
        node("n", "ND_multiply_color3", given("color3f in1 < i", "color3f in2 = (1, 1, 1)"))
        + node("i", "ND_image_color3", given("color3f default = (0.25, 0.5, 0.75)")),
        (0.25, 0.5, 0.75),
    ),
}


@pytest.mark.parametrize("case", CONSTANTS)
def test_constants_fold(case: str) -> None:
    nodes, expected = CONSTANTS[case]
    surface, _ = surface_of(
        material("color3f inputs:base_color.connect = </m/n.outputs:out>\n float inputs:base = 1", nodes, shader=STANDARD)
    )
    assert surface.constant("open_pbr_base_color") == pytest.approx(expected)
    assert (surface.inputs, surface.pattern) == ((), None)


def test_an_image_is_a_texture(image: str) -> None:
    surface = fed(node("n", "ND_tiledimage_color3", f"asset inputs:file = @{image}@\n float2 inputs:uvtiling = (2, 4)"))
    made = varying(surface)
    assert isinstance(made, TextureInput)
    assert (made.st, made.st_transform, made.wrap_s) == (PrimvarInput("st", (0.0, 0.0)), (2, 0, 0, 0, 4, 0), Wrap.REPEAT)
    assert surface.pattern is None


def test_coordinates_are_placed_as_the_library_places_them(image: str) -> None:
    place = node(
        "place",
        "ND_place2d_vector2",
        "float2 inputs:texcoord.connect = </m/uv.outputs:out>\n float2 inputs:scale = (2, 4)\n float inputs:rotate = 90\n"
        " float2 inputs:offset = (0.5, 0.25)",
        "float2 outputs:out",
    )
    uv = node("uv", "ND_geompropvalue_vector2", 'string inputs:geomprop = "map1"', "float2 outputs:out")
    text = f"asset inputs:file = @{image}@\n float2 inputs:texcoord.connect = </m/place.outputs:out>"
    made = varying(fed(node("n", "ND_image_color3", text) + place + uv))
    assert isinstance(made, TextureInput)
    assert made.st.name == "map1"
    # Divided by the scale, turned clockwise, moved back: (u, v) -> (v / 4 - 0.5, -u / 2 - 0.25).
    assert made.st_transform == pytest.approx((0, 0.25, -0.5, -0.5, 0, -0.25), abs=1e-15)


def test_scales_and_biases_of_an_image_stay_a_texture(image: str) -> None:
    nodes = node("n", "ND_subtract_color3FA", "color3f inputs:in1.connect = </m/by.outputs:out>\n float inputs:in2 = 0.25")
    nodes += node(
        "by", "ND_multiply_color3", "color3f inputs:in1.connect = </m/i.outputs:out>\n color3f inputs:in2 = (1, 2, 3)"
    )
    nodes += node("i", "ND_image_color3", f"asset inputs:file = @{image}@\n color3f inputs:default = (1, 1, 1)")
    made = varying(fed(nodes))
    assert isinstance(made, TextureInput)
    assert (made.scale[:3], made.bias[:3], made.fallback[:3]) == ((1, 2, 3), (-0.25, -0.25, -0.25), (0.75, 1.75, 2.75))


def test_a_channel_of_an_image_is_a_texture(image: str) -> None:
    nodes = node("n", "ND_extract_color4", given("color4f in < i", "int index = 3"), "float outputs:out")
    nodes += node("i", "ND_image_color4", f"asset inputs:file = @{image}@", "color4f outputs:out")
    made = varying(fed(nodes, "specular_roughness", "float"), "open_pbr_specular_roughness")
    assert isinstance(made, TextureInput)
    assert made.channels == "a"


def test_a_normal_map_is_a_texture_in_tangent_space(image: str) -> None:
    nodes = node(
        "n",
        "ND_normalmap_float",
        "float3 inputs:in.connect = </m/i.outputs:out>\n float inputs:scale = 0.5",
        "float3 outputs:out",
    )
    nodes += node("i", "ND_image_vector3", f"asset inputs:file = @{image}@", "float3 outputs:out")
    made = varying(fed(nodes, "normal", "float3"), "normal")
    assert isinstance(made, TextureInput)
    assert (made.scale[:3], made.bias[:3]) == ((1.0, 1.0, 2.0), (-0.5, -0.5, -1.0))
    assert made.file.color_space == "raw"


def test_what_is_more_is_a_pattern_of_what_varies_alone() -> None:
    nodes = node(
        "n",
        "ND_mix_color3",
        "color3f inputs:fg.connect = </m/red.outputs:out>\n float inputs:mix.connect = </m/noise.outputs:out>",
    )
    nodes += node("red", "ND_multiply_color3FA", "color3f inputs:in1 = (1, 0, 0)\n float inputs:in2 = 0.5")
    nodes += node("noise", "ND_noise2d_float", "float inputs:amplitude = 2", "float outputs:out")
    surface = fed(nodes)
    assert isinstance(surface.pattern, Pattern)
    assert [n.signature for n in surface.pattern.nodes] == ["ND_noise2d_float", "ND_mix_color3"]
    assert dict(surface.pattern.nodes[1].inputs) == {"fg": (0.5, 0.0, 0.0), "bg": (0.0, 0.0, 0.0), "mix": NodeOutput(0, "out")}
    assert dict(surface.pattern.nodes[0].inputs)["texcoord"] == "UV0"
    assert surface.pattern.nodes[0].path == "/m/noise"
    made = varying(surface)
    assert isinstance(made, PatternInput)
    assert made.source == NodeOutput(1, "out")


def test_equal_nodes_are_one() -> None:
    nodes = "".join(node(f"n{i}", "ND_noise2d_float", "", "float outputs:out") for i in (1, 2))
    nodes += node("n", "ND_combine3_color3", "".join(f"float inputs:in{i}.connect = </m/n{i}.outputs:out>\n" for i in (1, 2)))
    surface = fed(nodes)
    assert surface.pattern is not None
    assert len(surface.pattern.nodes) == 2


def test_a_preview_surface_reads_patterns_too() -> None:
    nodes = node("n", "ND_noise2d_float", "", "float outputs:out")
    surface, told = surface_of(material("float inputs:roughness.connect = </m/n.outputs:out>", nodes))
    assert isinstance(varying(surface, "roughness"), PatternInput)
    assert told == []


def test_node_graphs_of_node_graphs_are_passed_through() -> None:
    inner = node("m", "ND_multiply_color3FA", given("color3f in1 = (1, 0.5, 0)", "float in2 < a/b.inputs:by"))
    inner = inner.replace("inputs:by.outputs:out>", "inputs:by>")
    graph = f"""def NodeGraph "a" {{
        float inputs:by = 0.5
        color3f outputs:out.connect = </m/a/b.outputs:out>
        def NodeGraph "b" {{
            float inputs:by.connect = </m/a.inputs:by>
            color3f outputs:out.connect = </m/a/b/m.outputs:out>
            {inner}
        }}
    }}
    """
    assert fed(graph, source="a").constant("open_pbr_base_color") == (0.5, 0.25, 0.0)


FAULTS = {
    "a circle": node("n", "ND_add_float", "float inputs:in1.connect = </m/n.outputs:out>", "float outputs:out"),
    "an unknown node": node("n", "ND_no_such_node"),
    "a closure": node("n", "ND_oren_nayar_diffuse_bsdf"),
    "a matrix": node("n", "ND_creatematrix_vector3_matrix33", "", "matrix3d outputs:out"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_faults_are_told_and_leave_defaults(case: str) -> None:
    text = material("color3f inputs:base_color.connect = </m/n.outputs:out>", FAULTS[case], shader=STANDARD)
    surface, told = surface_of(text)
    assert surface.path == "/m"
    assert told


def test_a_long_chain_is_bounded() -> None:
    nodes = "".join(
        node(f"n{i}", "ND_sin_float", f"float inputs:in.connect = </m/n{i + 1}.outputs:out>", "float outputs:out")
        for i in range(400)
    )
    _, told = surface_of(material("float inputs:coat.connect = </m/n0.outputs:out>", nodes, shader=STANDARD))
    assert {code for code, _ in told} == {"shader-connection"}


def test_a_graph_that_grows_without_end_is_bounded() -> None:
    def doubled(i: int) -> str:
        inputs = "".join(f"float inputs:in{k}.connect = </m/n{i + 1}.outputs:out>\n" for k in (1, 2))
        return node(f"n{i}", "ND_unifiednoise3d_float" if i % 2 else "ND_power_float", inputs, "float outputs:out")

    nodes = "".join(map(doubled, range(100)))
    surface, _ = surface_of(material("float inputs:coat.connect = </m/n0.outputs:out>", nodes, shader=STANDARD))
    assert surface.pattern is None or len(surface.pattern.nodes) <= 20_000
