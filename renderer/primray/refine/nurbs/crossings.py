"""Intersection of closed polylines with a grid: nodes along them, and chains of nodes within one cell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ...arrays import Doubles
from .basis import Indices
from .lines import Lines


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
