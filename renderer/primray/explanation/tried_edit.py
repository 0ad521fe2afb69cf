"""What an edit did to a pixel's tile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class TriedEdit:
    """An edit and what it did to the pixel's tile.

    `times`: the time to the same error over that without it, with its 95 % interval; `gain_s`: the seconds of CPU that the tile
    takes less to the error that it has, likewise. `change`: of the tile's light, relative, with its 95 % interval; `changes`:
    whether the picture differs there beyond its noise.
    """

    edit: str
    times: float
    times_range: tuple[float, float]
    gain_s: tuple[float, float]
    change: float
    change_range: tuple[float, float]
    changes: bool

    @property
    def halves(self) -> bool:
        """Whether the time is at most half, as far as the measurement can tell."""
        return self.times_range[1] <= 0.5

    def as_json(self) -> dict[str, Any]:
        return {
            "edit": self.edit,
            "times": self.times,
            "times_ci95": list(self.times_range),
            "gain_s_ci95": list(self.gain_s),
            "change": self.change,
            "change_ci95": list(self.change_range),
            "changes_picture": self.changes,
            "halves": self.halves,
        }
