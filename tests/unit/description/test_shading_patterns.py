"""What a pattern reads from outside: primvars, files, and the place and the view of the shape."""

from __future__ import annotations

from typing import Any

from primray.description.shading import (
    NodeOutput,
    Pattern,
    PatternNode,
    TextureFile,
    nodes_above,
    pattern_fallbacks,
    pattern_files,
    pattern_primvars,
    plain_images,
    reads_view,
    reads_world_space,
)

WOOD, MASK = TextureFile("wood.png", "auto"), TextureFile("mask.png", "auto")


def pattern(*nodes: tuple[str, str, dict[str, Any]]) -> Pattern:
    return Pattern(tuple(PatternNode(category, kind, "", tuple(inputs.items())) for category, kind, inputs in nodes))


def test_primvars_have_the_widest_use() -> None:
    made = pattern(
        ("geompropvalue", "float", {"geomprop": "wear"}),
        ("geompropvalue", "vector3", {"geomprop": "wear", "default": (1.0, 2.0, 3.0)}),
        ("texcoord", "vector2", {"index": (1.0,)}),
        ("geomcolor", "color4", {}),
        ("noise2d", "float", {"texcoord": "UV0"}),
    )
    assert pattern_primvars(made) == {"wear": 3, "st1": 2, "displayColor": 4, "st": 2}
    assert pattern_fallbacks(made, "wear") == {(0.0,), (1.0, 2.0, 3.0)}


def test_files_have_the_channels_that_are_read_of_them() -> None:
    made = pattern(
        ("image", "float", {"file": MASK}),
        ("image", "color3", {"file": WOOD}),
        ("image", "color4", {"file": WOOD}),
        ("image", "color3", {"file": TextureFile("", "auto")}),
    )
    assert pattern_files(made) == {MASK: {"r"}, WOOD: set("rgba")}


def test_images_are_plain_where_no_node_computes_their_coordinates() -> None:
    made = pattern(
        ("texcoord", "vector2", {"index": (1.0,)}),
        ("multiply", "vector2", {"in1": NodeOutput(0), "in2": (2.0, 2.0)}),
        ("image", "color3", {"file": WOOD, "texcoord": NodeOutput(0)}),
        ("image", "color3", {"file": MASK, "texcoord": NodeOutput(1)}),
        ("image", "color3", {"file": MASK}),
    )
    found = [(image.file.path, image.st.name) for image in plain_images(made)]
    assert found == [("wood.png", "st1"), ("mask.png", "st")]
    assert list(plain_images(None)) == []


def test_the_place_and_the_view_count_through_the_nodes_above() -> None:
    made = pattern(
        ("position", "vector3", {"space": "world"}),
        ("viewdirection", "vector3", {}),
        ("position", "vector3", {"space": "object"}),
        ("add", "vector3", {"in1": NodeOutput(0), "in2": (1.0, 1.0, 1.0)}),
        ("add", "vector3", {"in1": NodeOutput(1), "in2": NodeOutput(2)}),
    )
    assert [reads_world_space(made, k) for k in range(5)] == [True, False, False, True, False]
    assert [reads_view(made, k) for k in range(5)] == [False, True, False, False, True]
    assert nodes_above(made, 4) == [made.nodes[k] for k in (1, 2, 4)]
