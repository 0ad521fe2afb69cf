"""Trimming of a grid: trim curves flattened to closed polylines, their crossings with the grid, whole cells, and polygons of
the cells that loops run through.

A loop enters and leaves every cell that it runs through, since a grid line is inserted through the middle of each loop; so the
kept part of a cell has no holes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ...arrays import Doubles, Ints
from ...description import Direction, TrimCurve
from ...description.geometry import TrimLoop
from ..ear_clip import ear_clip
from .evaluation import Flags, Indices, Lines, bases, spans_of

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
    return _with_lines(u, low[:, 0], size[:, 0]), _with_lines(v, low[:, 1], size[:, 1])


def _with_lines(lines: Lines, low: Doubles, size: Doubles) -> Lines:
    has_none = np.searchsorted(lines.at, low + 0.1 * size) == np.searchsorted(lines.at, low + 0.9 * size)
    found = np.unique((low + MIDDLE * size)[has_none])
    where = np.searchsorted(lines.at, found, "right") - 1
    good = (where >= 0) & (where < len(lines.at) - 1)
    return lines.with_lines(where[good], found[good])


def trim_grid(loops: Sequence[Doubles], u: Lines, v: Lines, *, holes: bool) -> Trimmed:
    """Return the trimmed grid. `holes`: what an odd number of loops encloses is removed, else it is what is kept."""
    nodes = nodes_of(loops, u, v)
    kept = is_inside(nodes, u, v) ^ holes
    by_cell: dict[tuple[int, int], list[Chain]] = defaultdict(list)
    for chain in chains_of(nodes):
        by_cell[chain.cell].append(chain)
    whole = kept[:-1, :-1] & u.is_drawn & v.is_drawn[:, None]
    cut = _CutCells(nodes, u, v, kept)
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


class _CutCells:
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


class Kind(IntEnum):
    CORNER = 0  # vertex of the loop
    ON_U = 1  # crossing of a line of constant u
    ON_V = 2


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of all loops, one loop after another."""

    at: Doubles  # (K, 2)
    kind: Indices  # (K,)
    line: Indices  # (K,) index of the crossed line
    cell: Indices  # (K, 2) u, v: cell of the piece after each node; -1 if not drawn
    following: Indices  # (K,)


@dataclass(frozen=True)
class Chain:
    """Part of a loop within one cell, from one crossing to the next."""

    cell: tuple[int, int]
    nodes: tuple[int, ...]


def nodes_of(loops: Sequence[Doubles], u: Lines, v: Lines) -> Nodes:
    a = np.concatenate(loops)
    b = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    loop_of = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
    parts = [_corners(a), _on(u.at, 0, a, b), _on(v.at, 1, a, b)]
    segment, t, order, kind, line, at = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((order, t, segment))
    segment, kind, line, at = segment[order], kind[order], line[order], at[order]
    loop_of = loop_of[segment]
    following = np.arange(1, len(segment) + 1)
    ends = np.flatnonzero(np.append(loop_of[1:] != loop_of[:-1], True))
    following[ends] = np.append(0, ends[:-1] + 1)
    middle = (at + at[following]) / 2
    cell = np.stack([_cell(u, middle[:, 0]), _cell(v, middle[:, 1])], axis=1)
    for axis, (crossing, lines) in enumerate(((Kind.ON_U, u), (Kind.ON_V, v))):
        # Nothing is between two lines at the same parameter.
        both = (kind == crossing) & (kind[following] == crossing) & (line != line[following])
        both &= lines.at[line.clip(max=len(lines.at) - 1)] == lines.at[line[following].clip(max=len(lines.at) - 1)]
        cell[both, axis] = -1
    cell[(cell < 0).any(axis=1)] = -1
    return Nodes(at, kind, line, cell, following)


def _corners(a: Doubles) -> tuple[Indices, Doubles, Indices, Indices, Indices, Doubles]:
    k = np.arange(len(a))
    none = np.zeros_like(k)
    return k, np.zeros(len(a)), none, none + int(Kind.CORNER), none, a


def _on(lines: Doubles, axis: int, a: Doubles, b: Doubles) -> tuple[Indices, Doubles, Indices, Indices, Indices, Doubles]:
    """Return the nodes where segments cross lines of constant u or v (`axis`)."""
    low, high = np.minimum(a[:, axis], b[:, axis]), np.maximum(a[:, axis], b[:, axis])
    first, last = np.searchsorted(lines, low, "right"), np.searchsorted(lines, high, "left")
    count = np.maximum(last - first, 0)
    segment = np.repeat(np.arange(len(a)), count)
    line = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count) + first[segment]
    way = b[segment] - a[segment]
    t = (lines[line] - a[segment, axis]) / way[:, axis]
    at = a[segment] + t[:, None] * way
    at[:, axis] = lines[line]
    order = np.where(way[:, axis] > 0, line, -line)
    kind = np.full(len(segment), int(Kind.ON_V if axis else Kind.ON_U))
    return segment, t, order, kind, line, at


def _cell(lines: Lines, at: Doubles) -> Indices:
    found = np.searchsorted(lines.at, at, "right") - 1
    inside = (found >= 0) & (found < len(lines.at) - 1)
    drawn = np.append(lines.is_drawn, False)[found.clip(0)]
    return np.asarray(np.where(inside & drawn, found, -1))


def chains_of(nodes: Nodes) -> Iterator[Chain]:
    """Yield the chains in cells that are drawn."""
    starts = np.flatnonzero((nodes.kind != Kind.CORNER) & (nodes.cell[:, 0] >= 0))
    following, kind = nodes.following.tolist(), nodes.kind.tolist()
    for start, (i, j) in zip(starts.tolist(), nodes.cell[starts].tolist(), strict=True):
        run = [start, following[start]]
        while kind[run[-1]] == Kind.CORNER:
            run.append(following[run[-1]])
        yield Chain((i, j), tuple(run))


def is_inside(nodes: Nodes, u: Lines, v: Lines) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return whether an odd number of loops encloses each crossing of the grid's lines, (Mv, Mu)."""
    found = np.zeros((len(v.at), len(u.at)), bool)
    on_v = nodes.kind == Kind.ON_V
    rows, places = nodes.line[on_v], nodes.at[on_v, 0]
    order = np.lexsort((places, rows))
    rows, places = rows[order], places[order]
    ends = np.searchsorted(rows, np.arange(len(v.at) + 1))
    for j in range(len(v.at)):
        found[j] = np.searchsorted(places[ends[j] : ends[j + 1]], u.at) % 2
    return found


MOST_PARTS = 1 << 12  # per span of a curve
# Shares of the patch, different for u and v so that a diagonal through the grid's crossings stays off them.
EDGE, SHIFT = 1e-9, (1.37e-11, 0.83e-11)
BELOW, ABOVE = (1.0, 0.71), (0.83, 0.59)  # of EDGE
NO_AREA = 1e-12


@dataclass(frozen=True)
class Tolerance:
    """Allowed error of a polyline in pixels, and pixels per unit of each parameter."""

    pixels: float
    per_u: float
    per_v: float


def flattened(loop: TrimLoop, tolerance: Tolerance) -> Doubles:
    """Return points (K, 2) on the curves of a loop, without a repeated last one."""
    found = np.concatenate([_flattened_curve(curve, tolerance) for curve in loop])
    return np.asarray(found[(found != np.roll(found, 1, axis=0)).any(axis=1)])


def _flattened_curve(curve: TrimCurve, tolerance: Tolerance) -> Doubles:
    basis = curve.basis
    spans, knots = spans_of(basis), basis.knots
    low, high = np.maximum(knots[spans], basis.low), np.minimum(knots[spans + 1], basis.high)
    parts: Indices = np.full(len(spans), 1 if basis.order == 2 else 4, np.intp)
    for _ in range(3):
        points, span = _sampled(curve, spans, low, high, 2 * parts)
        off = _deviation(points, span, parts, tolerance)
        more = np.ceil(np.sqrt(off / tolerance.pixels)).astype(np.intp)
        if (more <= 1).all():
            break
        parts = np.minimum(parts * np.maximum(more, 1), MOST_PARTS)
    return _sampled(curve, spans, low, high, parts)[0]


def _sampled(curve: TrimCurve, spans: Indices, low: Doubles, high: Doubles, parts: Indices) -> tuple[Doubles, Indices]:
    """Return each span divided into `parts` plus the last point, with the index of each point's span."""
    of = np.repeat(np.arange(len(spans)), parts)
    within = np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)
    at = low[of] + (high[of] - low[of]) * within / parts[of]
    at, of = np.append(at, high[-1]), np.append(of, len(spans) - 1)
    b = bases(curve.basis, spans[of], at)
    found = np.add.reduce([b.values[:, k, None] * curve.points[b.first + k] for k in range(curve.basis.order)])
    return np.asarray(found[:, :2] / found[:, 2:]), of


def _deviation(points: Doubles, of: Indices, parts: Indices, tolerance: Tolerance) -> Doubles:
    """Return the largest distance in pixels, by span, of every second point from the line between its neighbours."""
    scale = np.array([tolerance.per_u, tolerance.per_v])
    off = np.linalg.norm((points[1::2] - (points[:-1:2] + points[2::2]) / 2) * scale, axis=1)
    found = np.zeros(len(parts))
    np.maximum.at(found, of[1::2], off)
    return found


def start_of(curve: TrimCurve) -> Doubles:
    return _point_at(curve, curve.basis.low, 0)


def end_of(curve: TrimCurve) -> Doubles:
    return _point_at(curve, curve.basis.high, -1)


def _point_at(curve: TrimCurve, parameter: float, span: int) -> Doubles:
    """Return the point (2,) at the curve's beginning or end."""
    b = bases(curve.basis, spans_of(curve.basis)[[span]], np.array([parameter]))
    found = b.values[0] @ curve.points[b.first[0] : b.first[0] + curve.basis.order]
    return np.asarray(found[:2] / found[2])


def area(loop: Doubles) -> float:
    """Return the signed area, positive for counter-clockwise loops."""
    x, y = (loop - loop[:1]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2


def off_the_grid(loop: Doubles, u: Direction, v: Direction) -> Doubles:
    """Return the loop moved imperceptibly, so that it passes through no crossing of the grid's lines; what runs along the
    patch's edge is moved beyond it."""
    out = loop.copy()
    for axis, direction in enumerate((u, v)):
        size = direction.high - direction.low
        x = loop[:, axis]
        out[:, axis] = x + SHIFT[axis] * size
        out[np.abs(x - direction.low) <= EDGE * size, axis] = direction.low - BELOW[axis] * EDGE * size
        out[np.abs(x - direction.high) <= EDGE * size, axis] = direction.high + ABOVE[axis] * EDGE * size
    return out


def encloses(loop: Doubles, point: Doubles) -> bool:
    a, b = loop - point, np.roll(loop, -1, axis=0) - point
    crossing = (a[:, 1] > 0) != (b[:, 1] > 0)
    a, b = a[crossing], b[crossing]
    x = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool(np.count_nonzero(x > 0) % 2)


def are_holes(loops: Sequence[Doubles]) -> bool:
    """Return whether all outermost loops run clockwise; then they are holes in the whole patch, since the kept part is on the
    left of curves."""
    outer = [
        loop
        for k, loop in enumerate(loops)
        if sum(encloses(other, loop[0]) for j, other in enumerate(loops) if j != k) % 2 == 0
    ]
    return bool(loops) and all(area(loop) < 0 for loop in outer)


def has_area(loop: Doubles, u: Direction, v: Direction) -> bool:
    return len(loop) > 2 and abs(area(loop)) > NO_AREA * (u.high - u.low) * (v.high - v.low)
