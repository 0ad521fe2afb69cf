"""What folding is made of: tuples of numbers by inputs' names, and functions of them that are told how many are wanted."""

from __future__ import annotations

from collections.abc import Callable

Numbers = tuple[float, ...]
Constants = dict[str, Numbers]
Fold = Callable[[Constants, int], Numbers]


def wide(value: Numbers, width: int) -> Numbers:
    """One number stands for as many as are wanted."""
    return value * width if len(value) == 1 else value


def each(function: Callable[..., float], *names: str) -> Fold:
    """The function of each component of the inputs of these names."""

    def fold(inputs: Constants, width: int) -> Numbers:
        return tuple(map(function, *(wide(inputs[name], width) for name in names)))

    return fold
