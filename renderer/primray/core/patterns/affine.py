"""Recognition of texture coordinates that are an affine function of a primvar.

For these the texture resolution that can be seen is known before rendering.
"""

from __future__ import annotations

from dataclasses import dataclass

from .node import SHIFT_RANGE
from .program import Operation, Program, Value


@dataclass(frozen=True)
class Form:
    """s x + t y + 1 z, for a primvar's s and t; a constant has no primvar."""

    primvar: int | None
    row: tuple[float, float, float]


@dataclass(frozen=True)
class Affine:
    """An affine map of a primvar's two numbers: a constant offset, rotation and scale."""

    primvar: int
    transform: tuple[float, ...]  # 2 x 3, row-major


class AffineForms:
    """Affine forms of the components of each operation; None where a component is not affine.

    Operands precede the operations that read them.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self._forms: list[list[Form | None]] = []

    def of(self, at: Value) -> Affine | None:
        """Return the affine map that these coordinates are, or None."""
        operations = self._program.operations
        while len(self._forms) <= at.operation:
            self._forms.append(self._made(operations[len(self._forms)]))
        s, t = self._forms[at.operation][at.first : at.first + 2]
        if s is None or t is None:
            return None
        primvars = {form.primvar for form in (s, t)} - {None}
        return Affine(primvars.pop(), (*s.row, *t.row)) if len(primvars) == 1 else None  # type: ignore[arg-type]

    def _made(self, operation: Operation) -> list[Form | None]:
        if isinstance(operation.data, tuple):
            return [Form(None, (0.0, 0.0, value)) for value in operation.data]
        if operation.name == "primvar" and operation.width == 2 and operation.data % SHIFT_RANGE == 0:
            number = operation.data // SHIFT_RANGE
            return [Form(number, (1.0, 0.0, 0.0)), Form(number, (0.0, 1.0, 0.0))]
        if operation.name == "pack":
            return [self._forms[number][first] for number, first, _ in operation.operands]
        if operation.name not in ("add", "subtract", "multiply", "divide"):
            return [None] * operation.width
        (a, a_first, a_step), (b, b_first, b_step) = operation.operands
        return [
            _combined(operation.name, self._forms[a][a_first + a_step * c], self._forms[b][b_first + b_step * c])
            for c in range(operation.width)
        ]


def _combined(name: str, a: Form | None, b: Form | None) -> Form | None:
    if a is None or b is None:
        return None
    if name == "multiply" and a.primvar is None:
        a, b = b, a
    if name in ("multiply", "divide"):
        if b.primvar is not None or (name == "divide" and not b.row[2]):
            return None
        factor = b.row[2] if name == "multiply" else 1 / b.row[2]
        return Form(a.primvar, (a.row[0] * factor, a.row[1] * factor, a.row[2] * factor))
    if a.primvar is not None and b.primvar is not None and a.primvar != b.primvar:
        return None
    sign = 1 if name == "add" else -1
    x, y, z = (p + sign * q for p, q in zip(a.row, b.row, strict=True))
    return Form(b.primvar if a.primvar is None else a.primvar, (x, y, z))
