"""How a prim that moves stands in its group at any time: its operations at their own samples, composed."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ...arrays import Doubles

Local = Callable[[float], Doubles]  # by the offset from the frame: (4, 4) parent_from_prim


class Mover:
    """A transform that changes, below another one or below none; what is between them stays as it is."""

    def __init__(self, above: Mover | None, between: Doubles, local: Local, times: Iterable[float]) -> None:
        self._above = above
        self._between = between
        self._local = local
        self.times: tuple[float, ...] = tuple(sorted({*times, *(above.times if above else ())}))
        self._known: dict[float, Doubles] = {}

    def at(self, offset: float) -> Doubles:
        """(4, 4) group_from_prim, so many time codes after the frame."""
        known = self._known.get(offset)
        if known is None:
            known = self._between @ self._local(offset)
            if self._above is not None:
                known = self._above.at(offset) @ known
            self._known[offset] = known
        return known
