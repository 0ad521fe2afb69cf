"""Patterns that cannot be computed: one value for each input, and a diagnostic; registers, and what is needed at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests import described

from primray.core import module
from primray.core.patterns.tape_upload import SharedInputs, TooLargeError, tape_of
from primray.core.scene_upload import upload
from primray.description import NodeOutput, Pattern, PatternInput, PatternNode, Surface

from .node_functions.test_procedural_places import plane
from .pictured import Graph, emitting

NO_FLOATS = np.zeros(0, np.float32)


def outside() -> SharedInputs:
    return SharedInputs(lambda name: 0, lambda file, channels: None, lambda file, wrap, axis: wrap.name, 0.0)


def uploaded(surface: Surface) -> tuple[Any, list[tuple[str, str, str]]]:
    camera = described.orthographic(described.translation(0, 0, 1), 1)
    made = described.describe([(plane(), np.eye(4))], [surface], camera=camera)
    scene, warnings, _ = upload(made.description, {}, 1.0, NO_FLOATS)
    return scene, warnings


@pytest.mark.parametrize(
    "node",
    [
        PatternNode("oren_nayar_diffuse_bsdf", "BSDF", "ND_oren_nayar_diffuse_bsdf", ()),
        PatternNode("unheard", "color3", "ND_unheard", ()),
        PatternNode("add", "color3", "ND_add_color3", (("in1", (1.0, 1.0, 1.0)),)),
    ],
    ids=["closure", "unknown", "without an input"],
)
def test_what_stands_in(node: PatternNode) -> None:
    inputs = (("emissive_color", PatternInput(NodeOutput(0), (0.25, 0.5, 0.75))),)
    surface = Surface("/m", lambert=True, inputs=inputs, pattern=Pattern((node,)))
    scene, warnings = uploaded(surface)
    ((code, path, message),) = warnings
    assert (code, path) == ("pattern-not-computed", "/m")
    assert node.signature in message
    np.testing.assert_allclose(described.render(scene, 1, max_depth=1).pixels()[0, 0, :3], [0.25, 0.5, 0.75])


def sums(count: int, all_at_once: bool) -> Surface:
    """Of so many matrices that are read once, or again at the end."""
    graph = Graph()
    at = graph.primvar("at", "vector4")
    made = []
    for k in range(count):
        row = graph.add("add", "vector4", {"in1": at, "in2": (float(k),) * 4})
        made.append(graph.add("creatematrix", "matrix44", {f"in{i}": row for i in range(1, 5)}))
    total = made[0]
    for other in reversed(made) if all_at_once else made:
        total = graph.add("add", "matrix44", {"in1": total, "in2": other})
    row = graph.add("extract", "vector4", {"in": total, "index": (0.0,)})
    surface = emitting(graph.nodes, row)
    return surface


def test_registers_are_used_again() -> None:
    """1000 sums in a row keep two at a time; where all are kept, it is too large, and said."""
    graph = Graph()
    total = graph.primvar("at", "color3")
    for k in range(1000):
        total = graph.add("multiply", "color3", {"in1": total, "in2": (1.0 + k,) * 3})
    tape_of(emitting(graph.nodes, total), outside())
    with pytest.raises(TooLargeError):
        tape_of(sums(200, True), outside())


def test_what_is_the_same_is_computed_once() -> None:
    graph = Graph()
    at = graph.primvar("at", "color3")
    twice = [graph.add("sin", "vector3", {"in": at}) for _ in range(2)]
    surface = emitting(graph.nodes, graph.add("add", "vector3", {"in1": twice[0], "in2": twice[1]}))
    surface = Surface("/m", inputs=surface.inputs, pattern=Pattern(tuple(graph.nodes)))
    rows: list[Any] = []

    class Kept:
        def __setattr__(self, name: str, value: Any) -> None:
            if name == "code":
                rows.extend(value.tolist())

    core = module()

    class Module:
        Tape, Wrap, PatternImage = Kept, core.Wrap, core.PatternImage
        pattern_operations, PATTERN_REGISTERS = core.pattern_operations, core.PATTERN_REGISTERS

    with described.core_in_use(Module):
        tape_of(surface, outside())
    assert [row[0] for row in rows].count(core.pattern_operations().index("sin")) == 1
