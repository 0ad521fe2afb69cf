"""Types of constant folding: inputs as tuples of numbers by name, and functions of them and of the output's width."""

from __future__ import annotations

from collections.abc import Callable

Numbers = tuple[float, ...]
Constants = dict[str, Numbers]
Fold = Callable[[Constants, int], Numbers]


def wide(value: Numbers, width: int) -> Numbers:
    """Return a value repeated to `width` components where it has one."""
    return value * width if len(value) == 1 else value


def each(function: Callable[..., float], *names: str) -> Fold:
    """Return the folding of a function applied to each component of these inputs."""

    def fold(inputs: Constants, width: int) -> Numbers:
        return tuple(map(function, *(wide(inputs[name], width) for name in names)))

    return fold
