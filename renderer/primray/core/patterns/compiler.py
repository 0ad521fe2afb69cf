"""Compilation of a surface's graph: the nodes that wanted outputs depend on, in order, none compiled twice.

`NODES` is the table of node functions; `NO_MEANING` has the reasons why nodes of some types cannot be computed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ...description import NodeOutput, Pattern, PatternNode
from ...description.pattern_reads import GEOMPROPS
from .node import NO_SHIFT, Node, NodeContext, Outputs
from .node_functions.compositing import CHANNEL_NODES, COMPOSITING_NODES
from .node_functions.geometry import GEOMETRY_NODES
from .node_functions.images import HEXTILE_NODES, IMAGE_NODES, NORMAL_MAP_NODES, USD_NODES
from .node_functions.math_nodes import ADJUSTMENT_NODES, MATH_NODES, MATRIX_NODES
from .node_functions.pbr import PBR_NODES
from .node_functions.procedural import NOISE_NODES, RAMP_NODES
from .program import Program, Value

# MaterialX's primitive nodes and USD's own, by category: the function that compiles a node.
NODES: dict[str, Callable[[Node], Outputs]] = {
    **ADJUSTMENT_NODES, **MATH_NODES, **NORMAL_MAP_NODES, **CHANNEL_NODES, **COMPOSITING_NODES, **GEOMETRY_NODES,
    **HEXTILE_NODES, **IMAGE_NODES, **MATRIX_NODES, **NOISE_NODES, **PBR_NODES, **RAMP_NODES, **USD_NODES,
}  # fmt: skip

_CLOSURE = "describes how a surface scatters or emits light, and has no numeric value"
_TEXT = "is a string, which has no numeric value"
# Reasons by type of a node's first output.
NO_MEANING = {
    "BSDF": _CLOSURE, "EDF": _CLOSURE, "VDF": _CLOSURE, "surfaceshader": _CLOSURE, "volumeshader": _CLOSURE,
    "lightshader": _CLOSURE, "material": _CLOSURE, "displacementshader": "displaces points, which takes place before shading",
    "string": _TEXT, "filename": _TEXT,
}  # fmt: skip


class UnknownNodeError(Exception):
    """A node that cannot be computed here, with the reason."""


@dataclass
class Graph:
    """A pattern during compilation: values of each node's outputs, by node and shift."""

    pattern: Pattern
    around: NodeContext
    program: Program = field(default_factory=Program)
    _values: dict[tuple[int, int], Outputs] = field(default_factory=dict)
    _steps: dict[int, list[Value]] = field(default_factory=dict)

    def value(self, source: NodeOutput, shift: int = NO_SHIFT) -> Value:
        for node in self._missing(source.node, shift):
            self._compile(node, shift)
        made = self._values[source.node, shift]
        return made[source.output] if isinstance(made, dict) else made

    def _missing(self, node: int, shift: int) -> list[int]:
        """Return the node and the nodes it depends on that have no value yet, dependencies first."""
        found: set[int] = set()
        left = [node]
        while left:
            number = left.pop()
            if number in found or (number, shift) in self._values:
                continue
            found.add(number)
            left.extend(v.node for _, v in self.pattern.nodes[number].inputs if isinstance(v, NodeOutput))
        return sorted(found)

    def _compile(self, number: int, shift: int) -> None:
        own = self.pattern.nodes[number]
        if shift != NO_SHIFT:
            for node in self._missing(number, NO_SHIFT):
                self._compile(node, NO_SHIFT)
        before = self.program.steps, self.program.steps_here
        self.program.steps, self.program.steps_here = [], None if shift == NO_SHIFT else iter(self._steps[number])
        made = self._written(own, shift)
        if shift == NO_SHIFT:
            self._steps[number] = self.program.steps
        self.program.steps, self.program.steps_here = before
        self._values[number, shift] = made

    def _written(self, own: PatternNode, shift: int) -> Outputs:
        write = NODES.get(own.category)
        if write is None or own.type in NO_MEANING:
            raise UnknownNodeError(f"{own.signature or own.category} {NO_MEANING.get(own.type, 'is not known')}")
        inputs = dict(own.inputs)

        def read(name: str, shift: int) -> Value:
            operand = inputs[name]
            if isinstance(operand, NodeOutput):
                return self.value(operand, shift)
            if isinstance(operand, tuple):
                return self.program.constant(*operand)
            if isinstance(operand, str) and operand in GEOMPROPS:
                return self._geometry(operand, shift)
            raise UnknownNodeError(f"{own.signature or own.category} has no number as its {name}")

        try:
            return write(Node(self.program, own, shift, self.around, read))
        except KeyError as missing:
            raise UnknownNodeError(f"{own.signature or own.category} has no input {missing}") from missing

    def _geometry(self, name: str, shift: int) -> Value:
        category, space = GEOMPROPS[name]
        made = self._written(
            PatternNode(category, "vector2" if category == "texcoord" else "vector3", "", (("space", space),)), shift
        )
        assert isinstance(made, Value)
        return made
