"""A node of a pattern as node functions see it: its inputs as values, with access to primvars and files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from ...description import PatternNode, TextureFile
from .program import Program, Value

# Components of each type.
WIDTHS = {
    "float": 1, "integer": 1, "boolean": 1, "vector2": 2, "vector3": 3, "color3": 3, "vector4": 4, "color4": 4,
    "matrix33": 9, "matrix44": 16,
}  # fmt: skip
SHIFT_RANGE = 8  # as the core's kShiftRange
NO_SHIFT, FOOTPRINT_SHIFTS, SLOPE_SHIFTS = 0, (1, 2), (3, 4)

Outputs = Value | dict[str, Value]  # a single output of any name, or outputs by name


class NodeContext(Protocol):
    """Access of nodes to what is outside the graph."""

    object_space: bool  # set where a node reads object space

    def primvar(self, name: str) -> int: ...
    def image(self, file: TextureFile, width: int, node: Node) -> int | None:
        """Return the file's number among the tape's images, as the node reads it; None where it cannot be read."""

    def frame(self) -> float: ...


@dataclass(frozen=True)
class Node:
    program: Program
    own: PatternNode
    shift: int  # 0: the shaded point; else a point nearby, for differences
    around: NodeContext
    read: Callable[[str, int], Value]  # the value of an input at a shift

    def __getitem__(self, name: str) -> Value:
        return self.read(name, self.shift)

    @property
    def type(self) -> str:
        return self.own.type

    @property
    def width(self) -> int:
        return WIDTHS[self.own.type]

    def has(self, name: str) -> bool:
        return any(own == name for own, _ in self.own.inputs)

    def text(self, name: str, otherwise: str = "") -> str:
        value = dict(self.own.inputs).get(name, otherwise)
        return value if isinstance(value, str) else otherwise

    def whole(self, name: str, otherwise: int = 0) -> int:
        """Return a constant integer input."""
        value = dict(self.own.inputs).get(name)
        return int(value[0]) if isinstance(value, tuple) and value else otherwise

    def file(self, name: str) -> TextureFile | None:
        value = dict(self.own.inputs).get(name)
        return value if isinstance(value, TextureFile) else None

    def shifted(self, number: int) -> int:
        """Return the data of an operation that reads at the node's shift."""
        return number * SHIFT_RANGE + self.shift
