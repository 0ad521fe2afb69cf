"""Test for triangles in pairs (a, c, d) and (a, b, c), which the core's bvh/pairs.hpp intersects as quads."""

from __future__ import annotations

from ..arrays import Ints

FEWEST = 512  # triangles; fewer do not gain from pairing


def is_paired(triangles: Ints) -> bool:
    """Return whether triangles (T, 3) are enough to be worth it and all in pairs."""
    if len(triangles) < FEWEST or len(triangles) % 2:
        return False
    first, second = triangles[::2], triangles[1::2]
    return bool((first[:, 0] == second[:, 0]).all() and (first[:, 1] == second[:, 2]).all())
