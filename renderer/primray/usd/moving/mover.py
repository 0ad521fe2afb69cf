"""Transform of a moving prim relative to its group at any time, composed from transform ops at their own samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ...arrays import Doubles

Local = Callable[[float], Doubles]  # offset from the frame -> (4, 4) parent_from_prim


class Mover:
    """Animated transform, below another one or none, with a static matrix between the two."""

    def __init__(self, above: Mover | None, between: Doubles, local: Local, times: Iterable[float]) -> None:
        self._above = above
        self._between = between
        self._local = local
        self.times: tuple[float, ...] = tuple(sorted({*times, *(above.times if above else ())}))
        self._known: dict[float, Doubles] = {}

    def at(self, offset: float) -> Doubles:
        """Return group_from_prim (4, 4) at an offset from the frame, in time codes."""
        known = self._known.get(offset)
        if known is None:
            known = self._between @ self._local(offset)
            if self._above is not None:
                known = self._above.at(offset) @ known
            self._known[offset] = known
        return known
