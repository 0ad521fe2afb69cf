"""What instances are called: the path of a native one, INSTANCER[n] of a point instancer's; nested ones one after the other.

Kept only where an AOV asks for instances. Names of a level are relative to what holds it, so that a nested instance's name is
all levels' names together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Names:
    """`prefix` and each one's text, or its number in brackets."""

    prefix: str
    texts: npt.NDArray[np.object_] | None = None
    numbers: npt.NDArray[np.integer[Any]] | None = None

    def of(self, i: int) -> str:
        if self.texts is not None:
            return self.prefix + str(self.texts[i])
        return self.prefix if self.numbers is None else f"{self.prefix}[{int(self.numbers[i])}]"

    def take(self, chosen: npt.NDArray[Any]) -> Names:
        return Names(
            self.prefix,
            None if self.texts is None else self.texts[chosen],
            None if self.numbers is None else self.numbers[chosen],
        )

    def below(self, outer: str) -> Names:
        return Names(outer + self.prefix, self.texts, self.numbers)


def texts(names: Sequence[str]) -> Names:
    return Names("", np.array(names, dtype=object))


# Of each level of a placement, outermost first: its number of instances and their names.
Levels = Sequence[tuple[int, Names | None]]


def name_of(levels: Levels, row: int) -> str:
    """Of one instance of a placement: the last level counts fastest."""
    parts = []
    for count, names in reversed(levels):
        row, own = divmod(row, count)
        parts.append("" if names is None else names.of(own))
    return "".join(reversed(parts))


def all_names(levels: Levels) -> Names | None:
    """Of all instances, in order; None where none has any."""
    if all(names is None for _, names in levels):
        return None
    return texts([name_of(levels, row) for row in range(math.prod(count for count, _ in levels))])
