"""Connected inputs of a UsdPreviewSurface, evaluated as those of MaterialX surfaces are."""

from __future__ import annotations

from collections.abc import Mapping

from ...description import Input, NodeOutput, Operand, Pattern, PatternInput, PrimvarInput
from ..materialx.expressions import MOST_NODES, TooManyNodesError
from ..scene.context import Context
from .network import Node, node_path
from .node_values import NodeValues
from .pruning import pruned
from .reducing import NO_PRIMVAR, Reducer
from .usd_nodes import is_uv_texture


class FedInputs:
    """Evaluation of the connected inputs of one surface."""

    def __init__(self, ctx: Context) -> None:
        self._ctx = ctx
        self._values = NodeValues(ctx)

    def read(
        self, shader: Node, source: Node, name: str, width: int, *, is_color: bool = False
    ) -> Input | tuple[float, ...] | None:
        """Return an input's value, constant or varying; None, reported, where it cannot be read.

        Normals are in tangent space.
        """
        try:
            value = self._values.output(source, width, shader, name, is_color=is_color)
            if name == "normal":
                return self._normal(value, source)
        except TooManyNodesError:
            message = f"{name} is connected to more than {MOST_NODES:,} nodes: its default is used."
            self._ctx.warn("shader-ignored", node_path(shader, self._ctx), message, f"inputs:{name}")
            return None
        if isinstance(value, NodeOutput):
            return Reducer(self._values.expressions.nodes).input(value, width)
        return value if isinstance(value, tuple) else None

    def pattern_of(self, inputs: Mapping[str, Input]) -> tuple[Pattern | None, dict[str, Input]]:
        """Return the pattern that varying inputs read, without unused nodes, and the inputs renumbered."""
        return pruned(self._values.expressions.nodes, inputs)

    def _normal(self, value: Operand | None, source: Node) -> Input | None:
        """Return a normal input: a texture or primvar as it is, else a MaterialX normalmap of the value moved to 0 to 1.

        A normal map without a file leaves the surface's own normal, whatever its fallback is.
        """
        if isinstance(value, tuple):
            faces_out = len(value) == 3 and value[2] > 0 and not is_uv_texture(source.id)
            return PrimvarInput(NO_PRIMVAR, value) if faces_out else None
        if not isinstance(value, NodeOutput):
            return None
        e = self._values.expressions
        reducer = Reducer(e.nodes)
        found = reducer.input(value, 3)
        if not isinstance(found, PatternInput):
            return found
        halved = e.apply("ND_multiply_vector3FA", in1=value, in2=(0.5,))
        mapped = e.apply("ND_normalmap_float", **{"in": e.apply("ND_add_vector3FA", in1=halved, in2=(0.5,))})
        return reducer.normal(mapped) if isinstance(mapped, NodeOutput) else None
