"""Inputs of a UsdPreviewSurface that MaterialX's nodes feed, where these are more than a texture or a primvar."""

from __future__ import annotations

from collections.abc import Mapping

from ...description import Input, NodeOutput, Operand, Pattern
from ..materialx.expressions import MOST_NODES, TooManyNodesError
from ..resolving.context import Context
from .network import Node, node_path
from .node_values import NodeValues
from .pruning import pruned
from .reducing import Reducer


class FedInputs:
    """Of one surface."""

    def __init__(self, ctx: Context) -> None:
        self._ctx = ctx
        self._values = NodeValues(ctx)

    def read(self, shader: Node, source: Node, name: str, width: int) -> Input | tuple[float, ...] | None:
        """A constant, or what varies; None, noted, where it cannot be read. A normal is in tangent space, as the surface's."""
        try:
            value = self._values.output(source, width, shader, name)
            if name == "normal" and value is not None:
                value = self._in_world(value)
        except TooManyNodesError:
            message = f"{name} is fed by more than {MOST_NODES:,} nodes: its default is used."
            self._ctx.warn("shader-ignored", node_path(shader, self._ctx), message, f"inputs:{name}")
            return None
        reducer = Reducer(self._values.expressions.nodes)
        if isinstance(value, NodeOutput):
            return reducer.normal(value) if name == "normal" else reducer.input(value, width)
        return value if isinstance(value, tuple) else None

    def pattern_of(self, inputs: Mapping[str, Input]) -> tuple[Pattern | None, dict[str, Input]]:
        return pruned(self._values.expressions.nodes, inputs)

    def _in_world(self, normal: Operand) -> Operand:
        """By MaterialX's own map, whose texels are from 0 to 1."""
        e = self._values.expressions
        halved = e.apply("ND_multiply_vector3FA", in1=normal, in2=(0.5,))
        return e.apply("ND_normalmap_float", **{"in": e.apply("ND_add_vector3FA", in1=halved, in2=(0.5,))})
