"""What patterns come to in a picture: a plane that emits their outputs, each pixel a face with inputs of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from tests import described

from primray.core.patterns.program import WIDTHS
from primray.core.surface_upload import Textures
from primray.description import (
    Floats,
    Interpolation,
    Mesh,
    NodeOutput,
    Operand,
    Pattern,
    PatternInput,
    PatternNode,
    Primvar,
    Surface,
)

Rows = npt.NDArray[np.float64]


@dataclass
class Graph:
    """Nodes as they are added."""

    nodes: list[PatternNode] = field(default_factory=list)

    def add(self, category: str, type: str, inputs: Mapping[str, Operand], signature: str = "") -> NodeOutput:
        self.nodes.append(PatternNode(category, type, signature, tuple(inputs.items()), f"/node{len(self.nodes)}"))
        return NodeOutput(len(self.nodes) - 1)

    def primvar(self, name: str, type: str) -> NodeOutput:
        zero = (0.0,) * WIDTHS[type]
        return self.add("geompropvalue", type, {"geomprop": name, "default": zero})


def parts(graph: Graph, source: NodeOutput, type: str) -> list[tuple[NodeOutput, int]]:
    """Outputs of three numbers at most that together have all of a value's, with how many each has."""
    if type.startswith("matrix"):
        vector = "vector3" if type == "matrix33" else "vector4"
        rows = [graph.add("extract", vector, {"in": source, "index": (float(k),)}) for k in range(int(type[-1]))]
        return [part for row in rows for part in parts(graph, row, vector)]
    width = WIDTHS[type]
    if width == 4:
        last = graph.add("extract", "float", {"in": source, "index": (3.0,)})
        return [(source, 3), (last, 1)]
    if width == 2:
        return [(graph.add("extract", "float", {"in": source, "index": (float(k),)}), 1) for k in range(2)]
    return [(source, width)]


@dataclass
class Strip:
    """A row of the picture."""

    surface: Surface
    primvars: Mapping[str, Floats]
    points: Floats | None = None


def emitting(nodes: Sequence[PatternNode], source: NodeOutput, sign: float = 1.0) -> Surface:
    """A surface that only emits an output, or what is negative of it."""
    graph = Graph(list(nodes))
    if sign < 0:
        source = graph.add("multiply", "color3", {"in1": source, "in2": (sign,)})
    inputs = (("emissive_color", PatternInput(source, (0.0, 0.0, 0.0))),)
    return Surface("/m", lambert=True, diffuse_color=(0.0, 0.0, 0.0), inputs=inputs, pattern=Pattern(tuple(graph.nodes)))


def strip_mesh(strip: Strip, row: int, surface: int, count: int) -> Mesh:
    x = np.arange(count, dtype=np.float32)
    corners = np.zeros((count, 4, 3), np.float32)
    corners[:, :, 0] = x[:, None] + np.array([0, 1, 1, 0])
    corners[:, :, 1] = row + np.array([0, 0, 1, 1])
    first = 4 * np.arange(count)[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)
    primvars = tuple(
        Primvar(name, Interpolation.FACE, np.repeat(values, 2, axis=0).astype(np.float32))
        for name, values in strip.primvars.items()
    )
    return Mesh(f"/strip{row}", corners.reshape(-1, 3), triangles, None, None, surface, primvars)


def render_strips(
    strips: Sequence[Strip], count: int, isa: str | None = None, lanes: int = 0, textures: Textures | None = None
) -> Rows:
    """(S, N, 3)."""
    shapes = [(strip_mesh(s, row, row, count), np.eye(4)) for row, s in enumerate(strips)]
    eye = described.translation(count / 2, len(strips) / 2, 1.0)
    camera = described.orthographic(eye, len(strips) / 2, count / len(strips))
    made = described.describe(
        shapes, [s.surface for s in strips], camera=camera, resolution=(count, len(strips)), textures=textures
    )
    scene = made.build(isa, filter_width=0.5)  # no sample near a pixel's edge, where the next face begins
    done = described.render(scene, 1, isa=isa, max_depth=1, lanes=lanes, splits=1)
    return np.asarray(done.pixels()[::-1, :, :3], np.float64)


@dataclass
class Case:
    """A graph over inputs, by name (N, width), and those of its outputs that are looked at, with their types."""

    graph: Graph
    primvars: Mapping[str, Floats]
    outputs: Mapping[str, tuple[NodeOutput, str]]


def evaluate(
    cases: Sequence[Case], isa: str | None = None, lanes: int = 0, textures: Textures | None = None
) -> list[dict[str, Rows]]:
    """By case and output, (N, width): what is positive of it, less what is negative."""
    strips: list[Strip] = []
    places: list[list[tuple[str, int, int]]] = []
    for case in cases:
        places.append([])
        graph = Graph(list(case.graph.nodes))
        for name, (source, type) in case.outputs.items():
            for part, width in parts(graph, source, type):
                places[-1].append((name, len(strips), width))
                strips += [Strip(emitting(graph.nodes, part, sign), case.primvars) for sign in (1.0, -1.0)]
    count = len(next(iter(cases[0].primvars.values())))
    picture = render_strips(strips, count, isa, lanes, textures)
    found: list[dict[str, Rows]] = []
    for of in places:
        made: dict[str, list[Rows]] = {}
        for name, row, width in of:
            made.setdefault(name, []).append((picture[row] - picture[row + 1])[:, :width])
        found.append({name: np.hstack(columns) for name, columns in made.items()})
    return found
