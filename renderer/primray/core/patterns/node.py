"""A node of a pattern as the functions of nodes see it: its inputs as values, and where the primvars and files are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from ...description import PatternNode, TextureFile
from .program import Program, Value

# Numbers of a type.
WIDTHS = {
    "float": 1, "integer": 1, "boolean": 1, "vector2": 2, "vector3": 3, "color3": 3, "vector4": 4, "color4": 4,
    "matrix33": 9, "matrix44": 16,
}  # fmt: skip
SHIFT_RANGE = 8  # as the core's kShiftRange
NO_SHIFT, FOOTPRINT_SHIFTS, SLOPE_SHIFTS = 0, (1, 2), (3, 4)

Outputs = Value | dict[str, Value]  # one, whatever it is called, or by name


class Surroundings(Protocol):
    """What is outside of the graph."""

    object_space: bool  # set where it is asked for

    def primvar(self, name: str) -> int: ...
    def image(self, file: TextureFile, width: int, node: Node) -> int | None:
        """Its number among the tape's images, as the node reads it; None where the file cannot be read."""

    def frame(self) -> float: ...


@dataclass(frozen=True)
class Node:
    program: Program
    own: PatternNode
    shift: int  # 0: here
    around: Surroundings
    read: Callable[[str, int], Value]  # an input, at a shift

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
        """A constant number."""
        value = dict(self.own.inputs).get(name)
        return int(value[0]) if isinstance(value, tuple) and value else otherwise

    def file(self, name: str) -> TextureFile | None:
        value = dict(self.own.inputs).get(name)
        return value if isinstance(value, TextureFile) else None

    def shifted(self, number: int) -> int:
        """Data of an operation that may be shifted."""
        return number * SHIFT_RANGE + self.shift
