"""Operations of a tape in single-assignment form, and the nodes of a pattern that append them.

The same operation on the same operands is one value: a row of numbers; a single number is broadcast where more are needed.
Operators on values append operations. Node functions see a node as its inputs' values, with access to primvars and files.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from ...description import PatternNode, TextureFile

Numbers = tuple[float, ...]
Operand = tuple[int, int, int]  # an operation, the component of its result that is first, and 1 or 0: it advances, or stays

# Operations that are folded where all operands are constants.
FOLDED: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b if b else 0.0,
    "min": min,
    "max": max,
    "sin": math.sin,
    "cos": math.cos,
}
# Step functions. At shifted points they keep the value of the shaded point: finite differences must not see jumps.
STEPS = {"floor", "less", "not_above", "equal", "cell2", "cell3", "flake"}


class Operation(NamedTuple):
    name: str  # one of the core's pattern_operations(), or "pack": concatenated operands
    width: int
    operands: tuple[Operand, ...]
    data: int | Numbers = 0  # numbers: those of a constant


@dataclass(slots=True, eq=False)
class Value:
    """A row of `width` numbers, from index `first` on, of an operation's result."""

    program: Program
    operation: int
    first: int
    width: int

    def __getitem__(self, component: int) -> Value:
        return Value(self.program, self.operation, self.first + range(self.width)[component], 1)

    def part(self, first: int, width: int) -> Value:
        return Value(self.program, self.operation, self.first + first, width)

    @property
    def components(self) -> list[Value]:
        return [self[c] for c in range(self.width)]

    @property
    def constant(self) -> Numbers | None:
        """The numbers, if they are known at compile time."""
        operation = self.program.operations[self.operation]
        return operation.data[self.first : self.first + self.width] if isinstance(operation.data, tuple) else None

    def __add__(self, other: Value | float) -> Value:
        return self.program.apply("add", self, other)

    def __radd__(self, other: float) -> Value:
        return self.program.apply("add", other, self)

    def __sub__(self, other: Value | float) -> Value:
        return self.program.apply("subtract", self, other)

    def __rsub__(self, other: float) -> Value:
        return self.program.apply("subtract", other, self)

    def __mul__(self, other: Value | float) -> Value:
        return self.program.apply("multiply", self, other)

    def __rmul__(self, other: float) -> Value:
        return self.program.apply("multiply", other, self)

    def __truediv__(self, other: Value | float) -> Value:
        return self.program.apply("divide", self, other)

    def __rtruediv__(self, other: float) -> Value:
        return self.program.apply("divide", other, self)

    def __neg__(self) -> Value:
        return 0.0 - self


class Program:
    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self._numbers: dict[Operation, int] = {}
        self.steps: list[Value] = []  # step values of the node that is being compiled, in order
        self.steps_here: Iterator[Value] | None = None  # at a shifted point: those of the same node, unshifted

    def constant(self, *numbers: float) -> Value:
        return self._value(Operation("constant", len(numbers), (), tuple(map(float, numbers))))

    def apply(self, name: str, *operands: Value | float, width: int = 0, data: int = 0) -> Value:
        """Append an operation: by component, or with a result of `width` components."""
        is_step = name in STEPS
        if is_step and self.steps_here is not None:
            return next(self.steps_here)
        values = [o if isinstance(o, Value) else self.constant(o) for o in operands]
        width = width or max(v.width for v in values)
        if name in FOLDED and (known := self._folded(name, values, width)) is not None:
            return self.constant(*known)
        read = tuple((v.operation, v.first, int(v.width > 1)) for v in values)
        value = self._value(Operation(name, width, read, data))
        if is_step:
            self.steps.append(value)
        return value

    def pack(self, parts: Sequence[Value]) -> Value:
        """Concatenate the components of values."""
        numbers = [v for part in parts for v in part.components]
        if all(v.constant is not None for v in numbers):
            return self.constant(*(n for v in numbers for n in v.constant or ()))
        first = numbers[0]
        if all((v.operation, v.first) == (first.operation, first.first + c) for c, v in enumerate(numbers)):
            return Value(self, first.operation, first.first, len(numbers))
        return self._value(Operation("pack", len(numbers), tuple((v.operation, v.first, 0) for v in numbers)))

    def wide(self, value: Value, width: int) -> Value:
        """Broadcast one number to `width` components."""
        return value if value.width == width else self.pack([value] * width)

    def _folded(self, name: str, values: Sequence[Value], width: int) -> list[float] | None:
        known = [v.constant for v in values]
        if any(numbers is None for numbers in known):
            return None
        each = [numbers * width if len(numbers) == 1 else numbers for numbers in known if numbers is not None]
        return [float(FOLDED[name](*(numbers[c] for numbers in each))) for c in range(width)]

    def _value(self, operation: Operation) -> Value:
        number = self._numbers.get(operation)
        if number is None:
            number = self._numbers[operation] = len(self.operations)
            self.operations.append(operation)
        return Value(self, number, 0, operation.width)

    # Functions of any number of components.
    def select(self, condition: Value, yes: Value | float, no: Value | float) -> Value:
        return self.apply("select", condition, yes, no)

    def less(self, a: Value | float, b: Value | float) -> Value:
        return self.apply("less", a, b)

    def not_above(self, a: Value | float, b: Value | float) -> Value:
        return self.apply("not_above", a, b)

    def mix(self, a: Value | float, b: Value | float, share: Value | float) -> Value:
        return self.apply("mix", a, b, share)

    def clamp(self, x: Value, low: Value | float, high: Value | float) -> Value:
        return self.apply("min", self.apply("max", x, low), high)

    def floor(self, x: Value) -> Value:
        return self.apply("floor", x)

    def fract(self, x: Value) -> Value:
        return x - self.floor(x)

    def sqrt(self, x: Value) -> Value:
        return self.apply("sqrt", x)

    def dot(self, a: Value, b: Value) -> Value:
        return self.apply("dot", a, b, width=1, data=a.width)

    def cross(self, a: Value, b: Value) -> Value:
        return self.apply("cross", a, b, width=3)

    def normalize(self, x: Value) -> Value:
        """Return the vector scaled to unit length; 0 for the zero vector."""
        return x / self.sqrt(self.dot(x, x))


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
