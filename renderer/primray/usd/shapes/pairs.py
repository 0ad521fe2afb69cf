"""Reordering of triangles into pairs that form quads, which rays intersect faster (the core's bvh/pairs.hpp).

Every quad mesh has such pairs. Meshes that were triangulated before export list the two halves either one after the other, row
by row, or all first halves before all second halves. Other orders are left unchanged.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...arrays import Ints
from ...description.pairs import FEWEST
from .triangulate import Triangles

_NEXT, _LAST = (1, 2, 0), (2, 0, 1)


def paired(triangles: Triangles) -> Triangles:
    """Return the triangles in pairs (a, c, d) and (a, b, c) if all of them pair up, otherwise unchanged."""
    points = triangles.points
    count = len(points)
    if count < FEWEST or count % 2:
        return triangles
    for distance in _distances(points):
        halves = points.reshape(-1, 2, distance, 3).swapaxes(0, 1).reshape(2, -1, 3)
        found = _turns(halves)
        if found is not None:
            return _put(triangles, distance, *found)
    return triangles


def _distances(points: Ints) -> list[int]:
    """Return the possible offsets from a triangle to the one that shares an edge with it, limited to those that divide the
    triangle count evenly."""
    first = points[0]
    shared = (points == first[0]).astype(np.int8)
    shared += points == first[1]
    shared += points == first[2]
    neighbours = np.flatnonzero(shared.sum(axis=1) == 2)
    return [d for d in neighbours.tolist() if d > 0 and len(points) % (2 * d) == 0]


def _turns(halves: npt.NDArray[np.int32]) -> tuple[int, int, int] | None:
    """Return which half comes first, the index of its corner d and that of corner b in the other half; None if no choice fits
    all pairs."""
    for lead in (1, 0):
        first, second = halves[lead], halves[1 - lead]
        for d in (2, 0, 1):
            for b in (1, 2, 0):
                if first[0, _NEXT[d]] != second[0, _LAST[b]] or first[0, _LAST[d]] != second[0, _NEXT[b]]:
                    continue
                if (first[:, _NEXT[d]] == second[:, _LAST[b]]).all() and (first[:, _LAST[d]] == second[:, _NEXT[b]]).all():
                    return lead, d, b
    return None


def _put(triangles: Triangles, distance: int, lead: int, d: int, b: int) -> Triangles:
    turns = ((_NEXT[d], _LAST[d], d), (_LAST[b], b, _NEXT[b]))

    def put(of: Ints) -> Ints:
        halves = of.reshape(-1, 2, distance, *of.shape[1:]).swapaxes(0, 1).reshape(2, -1, *of.shape[1:])
        made = np.empty((len(of) // 2, 2, *of.shape[1:]), of.dtype)
        for k, turn in enumerate(turns):
            half = halves[lead if k == 0 else 1 - lead]
            made[:, k] = half if of.ndim == 1 else half.take(turn, axis=1)
        return made.reshape(of.shape)

    return Triangles(put(triangles.points), put(triangles.corners), put(triangles.faces))
