# SPDX-License-Identifier: GPL-3.0-or-later
"""Places of prims from Blender's matrices: rows of a matrix for row vectors, as USD's are. Knows nothing of USD."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def local_rows(world: Any, parent: Any, has_parent: bool) -> list[list[float]] | None:
    """Return the rows of an object's transform below its parent; None where that is not known."""
    if world is None or (has_parent and parent is None):
        return None
    if not has_parent:
        return rows(world)
    try:
        return rows(parent.inverted() @ world)
    except ValueError:  # a parent of no size
        return None


def light_rows(world: Any, keeps_scale: bool, extra: Sequence[float] = (1.0, 1.0)) -> list[list[float]]:
    """Return the rows of a lamp's or camera's transform: without scale if Blender's has none, scaled by `extra` first."""
    if not keeps_scale:
        location, rotation, _ = world.decompose()
        world = rotation.to_matrix().to_4x4()
        world.translation = location
    found = rows(world)
    for row, scale in zip(found, extra, strict=False):
        row[:] = [value * scale for value in row]
    return found


def rows(matrix: Any) -> list[list[float]]:
    return [list(column) for column in matrix.transposed()]
