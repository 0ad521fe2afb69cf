"""What the core's numbers mean: which shape each row is of, which instance each matrix. Kept where AOVs are asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from .instance_names import Levels, name_of

Numbers = npt.NDArray[np.integer[Any]]
WIDE = "aov:"  # before a primvar's name: all of its numbers, where surfaces read fewer of them


@dataclass
class SceneRecord:
    """Filled while a scene is handed over."""

    shape_paths: list[str] = field(default_factory=list)
    surface_paths: list[str] = field(default_factory=list)
    # By the core's row: number of the shape, and the instance's name where it stands in the world as the only one.
    meshes: list[tuple[int, str]] = field(default_factory=list)
    spheres: list[tuple[int, str]] = field(default_factory=list)
    # By the core's placement: its levels' names, and the rows that it has, or None for all.
    placements: list[tuple[Levels, Numbers | None]] = field(default_factory=list)
    primvar_names: dict[str, int] = field(default_factory=dict)  # the core's number of each
    primvar_widths: dict[str, int] = field(default_factory=dict)  # the widest of any shape

    def note_shape(self, rows: list[tuple[int, str]], shape: int, instance: str, end: int) -> None:
        rows.extend([(shape, instance)] * (end - len(rows)))

    def note_primvar(self, name: str, width: int) -> None:
        self.primvar_widths[name] = max(self.primvar_widths.get(name, 0), width)

    def width_of(self, primvar: str) -> int:
        """Numbers a row of a primvar, 0 where no shape has it."""
        return max(self.primvar_widths.get(primvar, 0), self.primvar_widths.get(WIDE + primvar, 0))


@dataclass(frozen=True)
class InstanceNumbers:
    """One number from 1 on for every instance in the world, in the core's order; those inside others count in each of these."""

    record: SceneRecord
    group: Numbers  # by placement
    first: Numbers  # by placement: its first row
    parent: Numbers  # by placement: the group that it stands in, 0 the world
    total: int  # rows

    @property
    def counts(self) -> Numbers:
        return np.diff(np.append(self.first, self.total)).astype(np.int64)

    def inside(self, group: int) -> tuple[int, int]:
        """Rows of a group that holds placements, which follow each other: the first, and how many; (0, 1) of others."""
        of = np.flatnonzero(self.parent == group) if group else np.zeros(0, np.int64)
        return (int(self.first[of[0]]), int(self.counts[of].sum())) if len(of) else (0, 1)

    def bases(self) -> tuple[Numbers, int]:
        """By placement in the world: the number of its first instance; and how many numbers there are."""
        each = np.array([self.inside(int(g))[1] for g in self.group], np.int64)
        numbers = np.where(self.parent == 0, self.counts * each, 0)
        ends = np.cumsum(numbers)
        return ends - numbers + 1, int(ends[-1]) if len(ends) else 0

    def number(self, rows: Numbers, outer: Numbers | None) -> npt.NDArray[np.uint32]:
        """Of hits in an instance's row, or -1; `outer` likewise the row that this stands in."""
        ids = np.zeros(rows.shape, np.uint32)
        if len(self.first) == 0:
            return ids
        bases, _ = self.bases()
        grouped = np.zeros(rows.shape, bool) if outer is None else outer >= 0
        alone = (rows >= 0) & ~grouped
        placement = self._placement(rows[alone])
        ids[alone] = bases[placement] + rows[alone] - self.first[placement]
        if outer is not None and grouped.any():
            placement = self._placement(outer[grouped])
            inside = np.array([self.inside(int(g)) for g in self.group], np.int64)[placement]
            stands = outer[grouped].astype(np.int64) - self.first[placement]
            ids[grouped] = bases[placement] + stands * inside[:, 1] + rows[grouped] - inside[:, 0]
        return ids

    def name(self, number: int) -> str:
        """What the instance of a number is called."""
        bases, _ = self.bases()
        top = np.flatnonzero(self.parent == 0)
        placement = int(top[np.searchsorted(bases[top], number, side="right") - 1])
        first, count = self.inside(int(self.group[placement]))
        row, own = divmod(number - int(bases[placement]), count)
        name = self._name(placement, row)
        if not np.any(self.parent == self.group[placement]):
            return name
        inner = int(self._placement(np.array([first + own]))[0])
        return name + self._name(inner, first + own - int(self.first[inner]))

    def _placement(self, rows: Numbers) -> Numbers:
        return np.searchsorted(self.first, rows, side="right") - 1

    def _name(self, placement: int, row: int) -> str:
        levels, kept = self.record.placements[placement]
        return name_of(levels, row if kept is None else int(kept[row]))
