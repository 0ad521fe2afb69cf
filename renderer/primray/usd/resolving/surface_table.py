"""The distinct surfaces of a scene, by the numbers that shapes have for them."""

from __future__ import annotations

from collections.abc import Iterator

from ...description import Surface


class SurfaceTable:
    def __init__(self) -> None:
        self._numbers: dict[Surface, int] = {}  # in order
        self._by_id: dict[int, int] = {}  # of the very objects that are kept

    def __iter__(self) -> Iterator[Surface]:
        return iter(self._numbers)

    def index_of(self, surface: Surface) -> int:
        """The index of an equal surface, added if there is none."""
        known = self._by_id.get(id(surface))  # comparing and hashing all of its numbers takes longer
        if known is not None:
            return known
        new = len(self._numbers)
        number = self._numbers.setdefault(surface, new)
        if number == new:  # this very object is kept
            self._by_id[id(surface)] = number
        return number
