"""Triangles of a mesh that stand in pairs, (a, c, d) and (a, b, c), as the core's bvh/pairs.hpp wants them."""

from __future__ import annotations

from ..arrays import Ints

FEWEST = 512  # triangles; below, nothing is to be won


def is_paired(triangles: Ints) -> bool:
    """Whether triangles (T, 3) of points are many and all stand in pairs."""
    if len(triangles) < FEWEST or len(triangles) % 2:
        return False
    first, second = triangles[::2], triangles[1::2]
    return bool((first[:, 0] == second[:, 0]).all() and (first[:, 1] == second[:, 2]).all())
