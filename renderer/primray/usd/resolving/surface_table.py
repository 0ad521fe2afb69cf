"""Table of the distinct surfaces of a scene."""

from __future__ import annotations

from collections.abc import Iterator

from ...description import Surface


class SurfaceTable:
    """Distinct surfaces, numbered as shapes refer to them."""

    def __init__(self) -> None:
        self._numbers: dict[Surface, int] = {}  # in order of their numbers
        self._by_id: dict[int, int] = {}  # numbers by identity of the stored surfaces

    def __iter__(self) -> Iterator[Surface]:
        return iter(self._numbers)

    def index_of(self, surface: Surface) -> int:
        """Return the index of an equal surface, added if there is none."""
        known = self._by_id.get(id(surface))  # comparing and hashing a whole surface is slower
        if known is not None:
            return known
        new = len(self._numbers)
        number = self._numbers.setdefault(surface, new)
        if number == new:  # the object itself was stored
            self._by_id[id(surface)] = number
        return number
