"""The same bits for any number of lanes, alone or among others; and lights, holes and averages that know patterns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import described
from tests.described import Described

from primray.description import LightType, NodeOutput, PatternInput, Surface

from .library import primitives
from .node_functions.test_math_nodes import graph_of, meant
from .node_functions.test_procedural_places import plane, st
from .pictured import Graph, emitting, evaluate


@pytest.mark.parametrize("isa", described.ISAS)
def test_lanes_do_not_show(isa: str) -> None:
    cases = [graph_of(d)[0] for d in meant(primitives()) if d.outputs[0][1] in ("float", "vector3", "color4", "multioutput")]
    module = described.core_module(isa)
    counts = [n for n in (1, 4, 8, 16) if n <= module.MAX_LANES]
    first = evaluate(cases, isa, counts[0])
    for lanes in counts[1:]:
        for one, other in zip(first, evaluate(cases, isa, lanes), strict=True):
            for name, values in one.items():
                np.testing.assert_array_equal(values, other[name], err_msg=f"{lanes} lanes: {name}")


def checks(graph: Graph) -> NodeOutput:
    """1 where both halves of st agree, else 0."""
    at = graph.add("texcoord", "vector2", {"index": (0.0,)})
    s, t = (graph.add("extract", "float", {"in": at, "index": (float(k),)}) for k in range(2))
    low = [
        graph.add("ifgreater", "float", {"value1": x, "value2": (y,), "in1": (1.0,), "in2": (0.0,)})
        for x, y in ((s, 1.0), (t, 0.5))
    ]
    return graph.add("ifequal", "float", {"value1": low[0], "value2": low[1], "in1": (1.0,), "in2": (0.0,)})


def scene(surface: Surface, light: bool) -> Described:
    camera = described.orthographic(described.translation(0, 0, 5), 9)
    shapes = [(plane((st(),)), np.eye(4))]
    lights = [described.light(LightType.DOME)] if light else []
    return described.describe(shapes, [surface], lights, camera=camera, resolution=(8, 8))


def test_albedo_is_a_pattern() -> None:
    graph = Graph()
    white = emitting(graph.nodes, checks(graph))
    surface = replace(white, inputs=(("diffuse_color", white.inputs[0][1]),))
    assert isinstance(surface.inputs[0][1], PatternInput)
    found = described.render(scene(surface, True).build(), 4, max_depth=1).pixels()[..., 0]
    want = np.kron(np.array([[0, 1], [1, 0]]), np.ones((4, 4)))
    np.testing.assert_allclose(found, want, atol=0.01)


@pytest.mark.parametrize("threshold", [0.0, 0.5])
def test_opacity_is_a_pattern(threshold: float) -> None:
    """Where it is 0 the dome is seen: through holes, and through what is not there."""
    graph = Graph()
    white = emitting(graph.nodes, checks(graph))
    inputs = (("opacity", white.inputs[0][1]),)
    surface = replace(white, inputs=inputs, opacity_threshold=threshold, presence=threshold == 0)
    found = described.render(scene(surface, True).build(), 4, max_depth=2).pixels()[..., 0]
    want = np.kron(np.array([[1, 0], [0, 1]]), np.ones((4, 4)))
    np.testing.assert_allclose(found, want, atol=0.01)


def test_emitting_pattern_is_a_light() -> None:
    """A wall that shines in part lights the floor as much by chosen points as by rays that find it."""
    graph = Graph()
    glow = emitting(graph.nodes, graph.add("multiply", "float", {"in1": checks(graph), "in2": (5.0,)}))
    surfaces = [replace(glow, pattern=replace(glow.pattern, nodes=tuple(graph.nodes))), described.lambert(0.5)]  # type: ignore[type-var]
    wall = described.quad([[-9, -9, -12], [9, -9, -12], [9, 9, -12], [-9, 9, -12]])
    wall = replace(wall, primvars=(st(),))
    floor = described.quad([[-9, -9, 9], [9, -9, 9], [9, -9, -12], [-9, -9, -12]], 1)
    camera = described.orthographic(described.translation(0, 10, -1) @ described.rotation((1, 0, 0), -90), 6)
    made = described.describe([(wall, np.eye(4)), (floor, np.eye(4))], surfaces, camera=camera, resolution=(4, 4)).build()
    assert made.sampled_lights == 1
    direct = described.render(made, 4096, max_depth=1).pixels()[..., 0].mean()
    assert 0.05 < direct < 5
