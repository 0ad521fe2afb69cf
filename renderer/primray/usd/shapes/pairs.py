"""Triangles put side by side where two of them make a quad, which rays meet faster (the core's bvh/pairs.hpp).

Meshes of quads have such pairs everywhere; those that were triangulated before list them one after the other, a row's or
all first ones before the second. Other orders are left as they are.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...arrays import Ints
from ...description.pairs import FEWEST
from .triangulate import Triangles

_NEXT, _LAST = (1, 2, 0), (2, 0, 1)


def paired(triangles: Triangles) -> Triangles:
    """The same triangles, two and two as (a, c, d) and (a, b, c), if they all pair; else as they were."""
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
    """How far behind the first triangle a triangle stands that shares an edge with it, where that divides them all."""
    first = points[0]
    shared = (points == first[0]).astype(np.int8)
    shared += points == first[1]
    shared += points == first[2]
    neighbours = np.flatnonzero(shared.sum(axis=1) == 2)
    return [d for d in neighbours.tolist() if d > 0 and len(points) % (2 * d) == 0]


def _turns(halves: npt.NDArray[np.int32]) -> tuple[int, int, int] | None:
    """Which half comes first, the number of its corner d, that of b in the other; None if no such are right for all."""
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
