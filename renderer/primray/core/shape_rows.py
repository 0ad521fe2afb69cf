"""Paths of the shapes that the core's rows are of, for what is said of single pixels. Every scene has one: a tuple a shape."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field


@dataclass
class ShapeRows:
    """Shapes by the core's rows of meshes and of curved shapes, in the order in which they were handed over."""

    _meshes: list[tuple[int, str]] = field(default_factory=list)  # the row after the shape's last, and its path
    _curved: list[tuple[int, str]] = field(default_factory=list)

    def note_mesh(self, end: int, path: str) -> None:
        """Take the rows up to `end` for the path's; without new ones, nothing."""
        _note(self._meshes, end, path)

    def note_curved(self, end: int, path: str) -> None:
        """Do as note_mesh, for curved shapes."""
        _note(self._curved, end, path)

    def path_of(self, number: int) -> str:
        """Return the path of what the core's plane "prim" calls `number`: rows of meshes from 0 on, of curved shapes from -2
        down; an empty string for -1, where nothing is seen."""
        rows, row = (self._meshes, number) if number >= 0 else (self._curved, -2 - number)
        at = bisect_right(rows, row, key=lambda found: found[0]) if row >= 0 else len(rows)
        return rows[at][1] if at < len(rows) else ""


def _note(rows: list[tuple[int, str]], end: int, path: str) -> None:
    if end > (rows[-1][0] if rows else 0):
        rows.append((end, path))
