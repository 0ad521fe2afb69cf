"""Paths of shapes by the core's row numbers, for reports on single pixels. Kept for every scene: one tuple for each shape."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field


@dataclass
class ShapeRows:
    """Shapes by the core's rows of meshes and of curved shapes, in upload order."""

    _meshes: list[tuple[int, str]] = field(default_factory=list)  # the row after the shape's last, and its path
    _curved: list[tuple[int, str]] = field(default_factory=list)

    def note_mesh(self, end: int, path: str) -> None:
        """Assign the rows up to `end` to the shape at `path`; do nothing if there are no new ones."""
        _note(self._meshes, end, path)

    def note_curved(self, end: int, path: str) -> None:
        """Assign rows of curved shapes, as `note_mesh` does."""
        _note(self._curved, end, path)

    def path_of(self, number: int) -> str:
        """Return the path of the shape that the core's plane "prim" calls `number`; an empty string for -1, no hit.

        Meshes are numbered by row from 0 up, curved shapes from -2 down.
        """
        rows, row = (self._meshes, number) if number >= 0 else (self._curved, -2 - number)
        at = bisect_right(rows, row, key=lambda found: found[0]) if row >= 0 else len(rows)
        return rows[at][1] if at < len(rows) else ""


def _note(rows: list[tuple[int, str]], end: int, path: str) -> None:
    if end > (rows[-1][0] if rows else 0):
        rows.append((end, path))
