"""Node definitions of the standard library, read from its document on demand.

A definition has its inputs with their defaults and, unless it is a primitive, the node graph that implements it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

from .documents import library

WIDTHS = {"float": 1, "integer": 1, "boolean": 1, "color3": 3, "color4": 4, "vector2": 2, "vector3": 3, "vector4": 4}
WIDTHS |= {"matrix33": 9, "matrix44": 16}
COLORS = ("color3", "color4")
CLOSURES = ("surfaceshader", "displacementshader", "volumeshader", "lightshader", "BSDF", "EDF", "VDF", "material")

Default = tuple[float, ...] | str | None  # str: text, or the name of a geometric property; None: a file or closure


@dataclass(frozen=True)
class InputDefinition:
    """An input of a node definition, with its default."""

    name: str
    type: str
    default: Default


@dataclass(frozen=True)
class FromInterface:
    """A reference to an input of the node that the graph implements."""

    name: str


@dataclass(frozen=True)
class FromStep:
    """A reference to an output of an earlier step."""

    step: int
    output: str


@dataclass(frozen=True)
class Step:
    """A node of an implementation graph: its definition, and the sources of the inputs that the graph sets."""

    definition: str
    inputs: tuple[tuple[str, Default | FromInterface | FromStep], ...]


@dataclass(frozen=True)
class Graph:
    """An implementation graph, its steps ordered so that each reads only earlier ones."""

    steps: tuple[Step, ...]
    outputs: tuple[tuple[str, Default | FromInterface | FromStep], ...]


@dataclass(frozen=True)
class Definition:
    """A node definition: its inputs and outputs."""

    name: str
    category: str
    inputs: tuple[InputDefinition, ...]
    outputs: tuple[tuple[str, str], ...]  # (name, type)

    @cached_property
    def type(self) -> str:
        return self.outputs[0][1]

    @cached_property
    def width(self) -> int:
        """Number of components of the first output; 0 where it is not numeric."""
        return WIDTHS.get(self.type, 0)

    @cached_property
    def as_wide(self) -> frozenset[str]:
        """Names of the inputs that have as many components as the first output."""
        return frozenset(i.name for i in self.inputs if self.width and WIDTHS.get(i.type) == self.width)

    @cached_property
    def defaults(self) -> dict[str, Default]:
        return {i.name: i.default for i in self.inputs}

    @cached_property
    def default_operands(self) -> dict[str, tuple[float, ...] | str]:
        """Defaults of the inputs that have one: all but files and closures."""
        return {i.name: i.default for i in self.inputs if i.default is not None}

    @cached_property
    def by_name(self) -> dict[str, InputDefinition]:
        return {i.name: i for i in self.inputs}

    @cached_property
    def output_widths(self) -> dict[str, int]:
        return {name: WIDTHS.get(kind, 0) for name, kind in self.outputs}

    @cached_property
    def gives_colors(self) -> bool:
        return any(kind in COLORS for _, kind in self.outputs)


@cache
def definition(name: str) -> Definition | None:
    """Return a definition of the standard library, None for an unknown name."""
    found = library().getNodeDef(name)
    if found is None:
        return None
    inputs = tuple(InputDefinition(i.getName(), i.getType(), default_of(i)) for i in found.getActiveInputs())
    outputs = tuple((o.getName(), o.getType()) for o in found.getActiveOutputs())
    return Definition(name, found.getNodeString(), inputs, outputs or (("out", found.getType()),))


def default_of(element: Any) -> Default:
    """Return an input's or output's value, or the name of the geometric property that is its default."""
    geometry = element.getAttribute("defaultgeomprop")
    if geometry:
        return str(geometry)
    kind = element.getType()
    if kind in ("filename", *CLOSURES):
        return None
    if kind not in WIDTHS:
        return str(element.getValueString())
    return numbers_of(element.getValueString(), WIDTHS[kind])


def numbers_of(text: str, width: int) -> tuple[float, ...]:
    """Return the numbers in a text, zeros where their count differs from `width`."""
    named = {"true": 1.0, "false": 0.0}
    try:
        found = tuple(named[p] if p in named else float(p) for p in (part.strip() for part in text.split(",")))
    except ValueError:
        found = ()
    return found if len(found) == width and all(map(math.isfinite, found)) else (0.0,) * width


@cache
def _graphs() -> dict[str, Any]:
    """Return the implementation graphs by the names of their definitions."""
    found = {graph.getNodeDefString(): graph for graph in library().getNodeGraphs() if graph.getNodeDefString()}
    for implementation in library().getImplementations():
        graph = (
            library().getNodeGraph(implementation.getAttribute("nodegraph"))
            if implementation.getAttribute("nodegraph")
            else None
        )
        if graph is not None:
            found[implementation.getNodeDefString()] = graph
    return found


@cache
def graph(name: str) -> Graph | None:
    """Return the graph that implements a definition, None for primitives."""
    found = _graphs().get(name)
    if found is None:
        return None
    nodes = _in_order(found)
    places = {node.getName(): (index, node.getNodeDef()) for index, node in enumerate(nodes)}
    steps = tuple(
        Step(node.getNodeDef().getName(), tuple((i.getName(), _source(i, places)) for i in node.getInputs())) for node in nodes
    )
    return Graph(steps, tuple((o.getName(), _source(o, places)) for o in found.getOutputs()))


def _in_order(found: Any) -> list[Any]:
    """Return a graph's nodes ordered so that each follows those that it reads."""
    ordered: dict[str, Any] = {}

    def visit(node: Any) -> None:
        for element in node.getInputs():
            other = found.getNode(element.getNodeName()) if element.getNodeName() else None
            if other is not None and other.getName() not in ordered:
                visit(other)
        ordered[node.getName()] = node

    for node in found.getNodes():
        if node.getName() not in ordered:
            visit(node)
    return list(ordered.values())


def _source(element: Any, places: dict[str, tuple[int, Any]]) -> Default | FromInterface | FromStep:
    if interface := element.getAttribute("interfacename"):
        return FromInterface(interface)
    if element.getNodeName() in places:
        index, node = places[element.getNodeName()]
        return FromStep(index, element.getAttribute("output") or node.getActiveOutputs()[0].getName())
    return default_of(element)
