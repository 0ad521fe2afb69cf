"""Meaning of the core's row numbers: which shape each row belongs to, which instance each matrix.

SceneRecord and InstanceNumbers serve AOVs and are kept only for them; ShapeRows serves reports on single pixels and is always
kept: one tuple for each shape.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..aovs import WIDE
from ..description.placement import Levels, instance_name

Numbers = npt.NDArray[np.integer[Any]]


@dataclass(kw_only=True)
class SceneRecord:
    """Paths and names by the core's row numbers, filled during upload."""

    shape_paths: list[str] = field(default_factory=list)
    surface_paths: list[str] = field(default_factory=list)
    names: dict[str, str] = field(default_factory=dict)  # names of shapes and surfaces whose path is inside one instance
    # Each row of the core: the shape's number, and the instance's name if it is the shape's only one, placed in the world.
    meshes: list[tuple[int, str]] = field(default_factory=list)
    curved: list[tuple[int, str]] = field(default_factory=list)
    # Each placement of the core: its levels' names, and the rows kept of them; None: all.
    placements: list[tuple[Levels, Numbers | None]] = field(default_factory=list)
    media: list[tuple[str, str]] = field(default_factory=list)  # paths of each volume in a grid, and of its material
    primvar_names: dict[str, int] = field(default_factory=dict)  # the core's numbers
    primvar_widths: dict[str, int] = field(default_factory=dict)  # the largest width on any shape

    def note_shape(self, rows: list[tuple[int, str]], shape: int, instance: str, end: int) -> None:
        rows.extend([(shape, instance)] * (end - len(rows)))

    def note_primvar(self, name: str, width: int) -> None:
        self.primvar_widths[name] = max(self.primvar_widths.get(name, 0), width)

    def width_of(self, primvar: str) -> int:
        """Return how many numbers a row of a primvar has, 0 where no shape has it."""
        return max(self.primvar_widths.get(primvar, 0), self.primvar_widths.get(WIDE + primvar, 0))


@dataclass(frozen=True)
class InstanceNumbers:
    """Numbers from 1 on for every instance in the world, in the core's order; nested instances count in each outer one."""

    record: SceneRecord
    group: Numbers  # by placement
    first: Numbers  # by placement: its first row
    parent: Numbers  # by placement: the group that contains it; 0: the world
    total: int  # rows

    @cached_property
    def counts(self) -> Numbers:
        return np.diff(np.append(self.first, self.total)).astype(np.int64)

    @cached_property
    def inside(self) -> dict[int, tuple[int, int]]:
        """First row and number of rows of the (consecutive) placements in each group that has any."""
        found: dict[int, tuple[int, int]] = {}
        for group, first, count in zip(self.parent.tolist(), self.first.tolist(), self.counts.tolist(), strict=True):
            if group:
                start, before = found.get(group, (first, 0))
                found[group] = (start, before + count)
        return found

    @cached_property
    def _inside(self) -> Numbers:
        """`inside` of the group that each placement places; (0, 1) for a group of shapes."""
        return np.array([self.inside.get(group, (0, 1)) for group in self.group.tolist()], np.int64).reshape(-1, 2)

    @cached_property
    def bases(self) -> Numbers:
        """Number of the first instance of each placement in the world."""
        return self._ends - self._numbers + 1

    @property
    def most(self) -> int:
        """Largest instance number."""
        return int(self._ends[-1]) if len(self._ends) else 0

    @cached_property
    def _numbers(self) -> Numbers:
        return np.where(self.parent == 0, self.counts * self._inside[:, 1], 0)

    @cached_property
    def _ends(self) -> Numbers:
        return np.cumsum(self._numbers)

    @cached_property
    def _top(self) -> Numbers:
        return np.flatnonzero(self.parent == 0)

    def number(self, rows: Numbers, outer: Numbers | None) -> npt.NDArray[np.uint32]:
        """Return the numbers of the instances that were hit.

        `rows`: the instance's row, -1 for none; `outer`: the row of the instance around it, -1 for none.
        """
        ids = np.zeros(rows.shape, np.uint32)
        if len(self.first) == 0:
            return ids
        grouped = np.zeros(rows.shape, bool) if outer is None else outer >= 0
        alone = (rows >= 0) & ~grouped
        placement = self._placement(rows[alone])
        ids[alone] = self.bases[placement] + rows[alone] - self.first[placement]
        if outer is not None and grouped.any():
            placement = self._placement(outer[grouped])
            inside = self._inside[placement]
            stands = outer[grouped].astype(np.int64) - self.first[placement]
            ids[grouped] = self.bases[placement] + stands * inside[:, 1] + rows[grouped] - inside[:, 0]
        return ids

    def name(self, number: int) -> str:
        """Return the name of the instance with a number."""
        placement = int(self._top[np.searchsorted(self.bases[self._top], number, side="right") - 1])
        group = int(self.group[placement])
        first, count = self.inside.get(group, (0, 1))
        row, own = divmod(number - int(self.bases[placement]), count)
        name = self._name(placement, row)
        if group not in self.inside:
            return name
        inner = int(self._placement(np.array([first + own]))[0])
        return name + self._name(inner, first + own - int(self.first[inner]))

    def _placement(self, rows: Numbers) -> Numbers:
        return np.searchsorted(self.first, rows, side="right") - 1

    def _name(self, placement: int, row: int) -> str:
        levels, kept = self.record.placements[placement]
        return instance_name(levels, row if kept is None else int(kept[row]))


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
