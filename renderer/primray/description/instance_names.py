"""Names of instances: the path of a native instance, INSTANCER[n] of a point instancer's; names of nested instances are
concatenated.

They are kept only if an AOV shows instances. Names of a level are relative to its parent, so that a nested instance's name is
the concatenation over all levels.
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
    """Names that consist of `prefix` and a text or a bracketed number per instance."""

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


# Number of instances and their names for each level of a placement, outermost first.
Levels = Sequence[tuple[int, Names | None]]


def name_of(levels: Levels, row: int) -> str:
    """Return the name of one instance (row) of a placement; the last level varies fastest."""
    parts = []
    for count, names in reversed(levels):
        row, own = divmod(row, count)
        parts.append("" if names is None else names.of(own))
    return "".join(reversed(parts))


def all_names(levels: Levels) -> Names | None:
    """Return the names of all instances, in order; None if none has a name."""
    if all(names is None for _, names in levels):
        return None
    return texts([name_of(levels, row) for row in range(math.prod(count for count, _ in levels))])
