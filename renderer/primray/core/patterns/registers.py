"""Register allocation for tapes: each value has consecutive registers until its last use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .program import Operation, Value


class Registers:
    """Free registers by length of their run; further ones are allocated where none fit."""

    def __init__(self) -> None:
        self.used = 0
        self._free: dict[int, list[int]] = {}

    def take(self, width: int) -> int:
        if free := self._free.get(width):
            return free.pop()
        self.used += width
        return self.used - width

    def give(self, first: int, width: int) -> None:
        self._free.setdefault(width, []).append(first)


def read_by(operations: Sequence[Operation], outputs: Sequence[Value]) -> dict[int, int]:
    """Return the last reader of each operation that some output depends on; outputs count as read at the end."""
    last = {v.operation: len(operations) for v in outputs}
    for number in range(len(operations) - 1, -1, -1):
        if number in last:
            for operand, _, _ in operations[number].operands:
                last.setdefault(operand, number)
    return last


def assemble(
    operations: Sequence[Operation], outputs: Sequence[Value], numbers: Mapping[str, int]
) -> tuple[list[list[int]], list[float], list[list[int]], int]:
    """Return the core's code, constants and outputs, and the number of registers. `numbers`: the core's opcodes."""
    last = read_by(operations, outputs)
    registers, at = Registers(), dict[int, int]()
    code: list[list[int]] = []
    constants: list[float] = []
    made: dict[int, int] = {}  # length of the code once each operation is computed
    for number in sorted(last):
        operation = operations[number]
        at[number] = registers.take(operation.width)
        code.extend(_rows(operation, at, at[number], numbers, constants))
        made[number] = len(code)
        for operand in {read for read, _, _ in operation.operands}:
            if last[operand] == number:
                registers.give(at[operand], operations[operand].width)
    found = [[at[v.operation] + v.first, int(v.width > 1), made[v.operation]] for v in outputs]
    return code, constants, found, registers.used


def _rows(
    operation: Operation, at: Mapping[int, int], out: int, numbers: Mapping[str, int], constants: list[float]
) -> list[list[int]]:
    places = [at[number] + first for number, first, _ in operation.operands]
    if operation.name == "pack":
        return [[numbers["move"], 1, 0, out + c, place, 0, 0, 0, 0] for c, place in enumerate(places)]
    steps = sum(step << k for k, (_, _, step) in enumerate(operation.operands))
    data = operation.data
    if isinstance(data, tuple):
        constants.extend(data)
        data = len(constants) - len(data)
    return [[numbers[operation.name], operation.width, steps, out, *(places + [0] * 4)[:4], data]]
