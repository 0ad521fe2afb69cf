"""Operands that are sums of fields times constants: the fields' own grids are rendered, and nothing is evaluated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ...description import NodeOutput, Operand, PatternNode
from ..materials.materialx.definitions import WIDTHS
from .fields import Field, field_named


@dataclass(frozen=True)
class LinearForm:
    """A constant, and the factor of each field that an operand is a sum of: (width,) each."""

    constant: Doubles
    factors: Mapping[str, Doubles]  # by the fields' names in the volume

    def times(self, by: Doubles) -> LinearForm:
        return LinearForm(self.constant * by, {name: factor * by for name, factor in self.factors.items()})

    def plus(self, other: LinearForm) -> LinearForm:
        names = [*self.factors, *(name for name in other.factors if name not in self.factors)]
        return LinearForm(
            self.constant + other.constant, {n: self.factors.get(n, 0.0) + other.factors.get(n, np.zeros(1)) for n in names}
        )

    @property
    def is_constant(self) -> bool:
        return not self.factors


def linear_form(operand: Operand, nodes: list[PatternNode], fields: Mapping[str, Field]) -> LinearForm | None:
    """Return an operand as a linear form; None where it is none.

    A field of three numbers a voxel counts where each of its channels is a channel of the operand, with one factor for each.
    """
    made: dict[int, LinearForm | None] = {}

    def of(value: object) -> LinearForm | None:
        if isinstance(value, tuple):
            return LinearForm(np.array(value, np.float64), {})
        return made[value.node] if isinstance(value, NodeOutput) else None

    if not isinstance(operand, NodeOutput):
        return of(operand)
    for number in range(operand.node + 1):  # nodes read only earlier ones
        made[number] = _form(nodes[number], of, fields)
    return made[operand.node]


def _form(node: PatternNode, of: Callable[[object], LinearForm | None], fields: Mapping[str, Field]) -> LinearForm | None:
    inputs, width = dict(node.inputs), WIDTHS.get(node.type, 0)
    if node.category == "geompropvalue" and width in (1, 3):
        found = field_named(fields, str(inputs["geomprop"]))
        if found is None:
            return of(inputs["default"])
        if found.grid.width > width:
            return None
        return LinearForm(np.zeros(width), {found.name: np.ones(width)})
    if node.category in ("constant", "dot"):
        return of(inputs["value" if node.category == "constant" else "in"])
    if node.category == "convert":
        given = of(inputs["in"])
        if given is None or width not in (1, 3) or len(given.constant) not in (1, width):
            return None
        return given.times(np.ones(width))
    if node.category.startswith("combine"):
        return _joined([of(inputs[name]) for name in ("in1", "in2", "in3", "in4") if name in inputs])
    if node.category not in ("multiply", "divide", "add", "subtract") or node.type.startswith("matrix"):
        return None
    a, b = of(inputs["in1"]), of(inputs["in2"])
    if a is None or b is None:
        return None
    if node.category in ("add", "subtract"):
        return a.plus(b if node.category == "add" else b.times(np.array(-1.0)))
    if node.category == "divide":
        return a.times(1.0 / b.constant) if b.is_constant and b.constant.all() else None
    if a.is_constant:
        a, b = b, a
    return a.times(b.constant) if b.is_constant else None


def _joined(parts: Sequence[LinearForm | None]) -> LinearForm | None:
    """Return the form of a value whose components are these, None where one of them is none."""
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    names = dict.fromkeys(name for part in known for name in part.factors)
    factors = {name: np.concatenate([part.factors.get(name, np.zeros(len(part.constant))) for part in known]) for name in names}
    return LinearForm(np.concatenate([part.constant for part in known]), factors)
