"""Coordinates that are a primvar's two numbers moved, turned and scaled by constants: for these it is known before rendering how
finely an image can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .node import SHIFT_RANGE
from .program import Operand, Program, Value

Row = npt.NDArray[np.float64]  # of s, t and 1


@dataclass(frozen=True)
class Affine:
    primvar: int
    transform: tuple[float, ...]  # 2 x 3, by rows


def affine_of(at: Value) -> Affine | None:
    """None where the coordinates are anything else."""
    found = [_component(at.program, at.operation, at.first + c) for c in range(2)]
    primvars = {primvar for row in found if row is not None for primvar in [row[0]] if primvar is not None}
    if any(row is None for row in found) or len(primvars) != 1:
        return None
    return Affine(primvars.pop(), tuple(float(x) for row in found if row is not None for x in row[1]))


def _component(program: Program, number: int, component: int) -> tuple[int | None, Row] | None:
    """A number as a sum of s, t and 1, and of which primvar."""
    operation = program.operations[number]
    if isinstance(operation.data, tuple):
        return None, np.array([0, 0, operation.data[component]])
    if operation.name == "primvar" and component < 2 and operation.width == 2 and operation.data % SHIFT_RANGE == 0:
        return operation.data // SHIFT_RANGE, np.eye(3)[component]
    if operation.name == "pack":
        return _component(program, *operation.operands[component][:2])
    if operation.name not in ("add", "subtract", "multiply", "divide"):
        return None
    return _combined(operation.name, [_operand(program, o, component) for o in operation.operands])


def _operand(program: Program, operand: Operand, component: int) -> tuple[int | None, Row] | None:
    number, first, step = operand
    return _component(program, number, first + step * component)


def _combined(name: str, parts: Sequence[tuple[int | None, Row] | None]) -> tuple[int | None, Row] | None:
    if parts[0] is None or parts[1] is None:
        return None
    (of_a, a), (of_b, b) = parts[0], parts[1]
    if of_a is not None and of_b is not None and of_a != of_b:
        return None
    of = of_b if of_a is None else of_a
    if name in ("add", "subtract"):
        return of, a + b if name == "add" else a - b
    if name == "multiply" and of_a is None:
        return of, b * a[2]
    if of_b is not None or (name == "divide" and not b[2]):
        return None
    return of, a * b[2] if name == "multiply" else a / b[2]
