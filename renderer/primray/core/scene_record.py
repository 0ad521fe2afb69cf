"""What the core's numbers mean: which shape each row is of, which instance each matrix. Kept where AOVs are asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..aov_names import WIDE
from ..description.instance_names import Levels, name_of

Numbers = npt.NDArray[np.integer[Any]]


@dataclass
class SceneRecord:
    """Filled while a scene is handed over."""

    shape_paths: list[str] = field(default_factory=list)
    surface_paths: list[str] = field(default_factory=list)
    names: dict[str, str] = field(
        default_factory=dict
    )  # what shapes and surfaces are called whose path is that of one instance
    # By the core's row: number of the shape, and the instance's name where it stands in the world as the only one.
    meshes: list[tuple[int, str]] = field(default_factory=list)
    curved: list[tuple[int, str]] = field(default_factory=list)
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

    @cached_property
    def counts(self) -> Numbers:
        return np.diff(np.append(self.first, self.total)).astype(np.int64)

    @cached_property
    def inside(self) -> dict[int, tuple[int, int]]:
        """By group that holds placements, which follow each other: their first row, and how many rows."""
        found: dict[int, tuple[int, int]] = {}
        for group, first, count in zip(self.parent.tolist(), self.first.tolist(), self.counts.tolist(), strict=True):
            if group:
                start, before = found.get(group, (first, 0))
                found[group] = (start, before + count)
        return found

    @cached_property
    def _inside(self) -> Numbers:
        """By placement, of the group that it places; (0, 1) of one with shapes."""
        return np.array([self.inside.get(group, (0, 1)) for group in self.group.tolist()], np.int64).reshape(-1, 2)

    @cached_property
    def bases(self) -> Numbers:
        """By placement in the world: the number of its first instance."""
        return self._ends - self._numbers + 1

    @property
    def most(self) -> int:
        """How many numbers there are."""
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
        """Of hits in an instance's row, or -1; `outer` likewise the row that this stands in."""
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
        """What the instance of a number is called."""
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
        return name_of(levels, row if kept is None else int(kept[row]))
