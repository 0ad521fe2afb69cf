# SPDX-License-Identifier: GPL-3.0-or-later
"""Places of prims from Blender's matrices: rows of a matrix for row vectors, as USD's are. Knows nothing of USD."""

from __future__ import annotations

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


def rows(matrix: Any) -> list[list[float]]:
    return [list(column) for column in matrix.transposed()]
