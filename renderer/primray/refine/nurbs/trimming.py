"""Trimming of a grid: whole cells, and polygons of the cells that trim loops run through.

A loop enters and leaves every cell that it runs through, since a grid line is inserted through the middle of each loop; so the
kept part of a cell has no holes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles, Ints
from ..ear_clip import ear_clip
from .basis import Indices
from .crossings import Chain, Kind, Nodes, chains_of, is_inside, nodes_of
from .lines import Flags, Lines

MIDDLE = 0.4871231  # relative position within a loop: symmetrical loops have no corner there


@dataclass(frozen=True, eq=False)
class Trimmed:
    """Result of trimming. Vertices are the grid's, row by row, followed by those `at` parameters."""

    whole: Flags  # (Mv - 1, Mu - 1) cells
    triangles: Ints  # (T, 3) in cells that are cut
    cells: Ints  # (T, 2) u, v of each triangle's cell
    at: Doubles  # (K, 2) parameters of vertices on loops
    inside: Indices  # (K, 2) u, v of a cell that each is in or next to


def with_lines_through(loops: Sequence[Doubles], u: Lines, v: Lines) -> tuple[Lines, Lines]:
    """Return the lines of both directions with at least one through each loop, well inside it and through none of its
    corners."""
    low = np.array([loop.min(axis=0) for loop in loops])
    size = np.array([loop.max(axis=0) for loop in loops]) - low
    return _with(u, low[:, 0], size[:, 0]), _with(v, low[:, 1], size[:, 1])


def _with(lines: Lines, low: Doubles, size: Doubles) -> Lines:
    has_none = np.searchsorted(lines.at, low + 0.1 * size) == np.searchsorted(lines.at, low + 0.9 * size)
    found = np.unique((low + MIDDLE * size)[has_none])
    where = np.searchsorted(lines.at, found, "right") - 1
    good = (where >= 0) & (where < len(lines.at) - 1)
    return lines.with_lines(where[good], found[good])


def trimmed(loops: Sequence[Doubles], u: Lines, v: Lines, *, holes: bool) -> Trimmed:
    """Return the trimmed grid. `holes`: what an odd number of loops encloses is removed, else it is what is kept."""
    nodes = nodes_of(loops, u, v)
    kept = is_inside(nodes, u, v) ^ holes
    by_cell: dict[tuple[int, int], list[Chain]] = defaultdict(list)
    for chain in chains_of(nodes):
        by_cell[chain.cell].append(chain)
    whole = kept[:-1, :-1] & u.is_drawn & v.is_drawn[:, None]
    cut = _Cut(nodes, u, v, kept)
    for cell, chains in by_cell.items():
        whole[cell[1], cell[0]] = False
        cut.add(cell, chains)
    triangles = np.array(cut.triangles, np.int32).reshape(-1, 3)
    inside = np.maximum(nodes.cell, 0)
    before = np.empty_like(nodes.following)
    before[nodes.following] = np.arange(len(before))
    from_before = (nodes.cell[:, 0] < 0)[:, None]  # the loop leaves the patch here
    return Trimmed(
        whole, triangles, np.array(cut.cells, np.int32).reshape(-1, 2), nodes.at, np.where(from_before, inside[before], inside)
    )


class _Cut:
    """Triangulation of cells that loops run through."""

    def __init__(self, nodes: Nodes, u: Lines, v: Lines, kept: Flags) -> None:
        self._nodes, self._u, self._v, self._kept = nodes, u.at, v.at, kept
        self._columns = len(u.at)
        self._grid = len(u.at) * len(v.at)
        self._at, self._kind, self._line = nodes.at.tolist(), nodes.kind.tolist(), nodes.line.tolist()
        self.triangles: list[tuple[int, int, int]] = []
        self.cells: list[tuple[int, int]] = []

    def add(self, cell: tuple[int, int], chains: list[Chain]) -> None:
        for polygon in self._polygons(cell, chains):
            places = np.array([self._place(cell, vertex) for vertex in polygon])
            for triangle in ear_clip(places).tolist():
                self.triangles.append(tuple(polygon[k] for k in triangle))
                self.cells.append(cell)

    def _polygons(self, cell: tuple[int, int], chains: list[Chain]) -> list[list[int]]:
        """Return the kept polygons of a cell, counter-clockwise: along its outline, then along a chain, and so on."""
        i, j = cell
        corners = [(j, i), (j, i + 1), (j + 1, i + 1), (j + 1, i)]
        events = sorted((self._around(cell, chain.nodes[end]), k, end) for k, chain in enumerate(chains) for end in (0, -1))
        number = {(k, end): n for n, (_, k, end) in enumerate(events)}
        todo = {n for n in range(len(events)) if bool(self._kept[corners[0]]) ^ (n % 2 == 0)}
        found = []
        while todo:
            first = n = min(todo)
            polygon: list[int] = []
            while True:
                todo.discard(n)
                here, k, end = events[n]
                polygon.append(self._grid + chains[k].nodes[end])
                n = (n + 1) % len(events)
                there, k, end = events[n]
                stop = there if there > here or len(events) == 1 else there + 4
                passed = [c for c in range(8) if here < c <= stop]
                polygon += [corners[c % 4][0] * self._columns + corners[c % 4][1] for c in passed]
                run = chains[k].nodes if end == 0 else chains[k].nodes[::-1]
                polygon += [self._grid + node for node in run[:-1]]
                n = number[k, -1 if end == 0 else 0]
                if n == first or n not in todo:
                    break
            found.append(polygon)
        return [polygon for polygon in found if len(polygon) > 2]

    def _around(self, cell: tuple[int, int], node: int) -> float:
        """Return the position on the cell's outline, 0 to 4, counter-clockwise from its first corner."""
        (i, j), (x, y), line = cell, self._at[node], self._line[node]
        if self._kind[node] == Kind.ON_V:
            share = (x - self._u[i]) / (self._u[i + 1] - self._u[i])
            return float(share if line == j else 3 - share)
        share = (y - self._v[j]) / (self._v[j + 1] - self._v[j])
        return float(1 + share if line == i + 1 else 4 - share)

    def _place(self, cell: tuple[int, int], vertex: int) -> tuple[float, float, float]:
        """Return a vertex's position relative to the cell, so that cells are neither thin nor small."""
        i, j = cell
        if vertex < self._grid:
            x, y = self._u[vertex % self._columns], self._v[vertex // self._columns]
        else:
            x, y = self._at[vertex - self._grid]
        low_u, low_v = self._u[i], self._v[j]
        return (x - low_u) / (self._u[i + 1] - low_u), (y - low_v) / (self._v[j + 1] - low_v), 0.0
