"""Closed shapes that light enters and whose faces look inwards: their inside is all that is outside.

A transform that mirrors changes nothing: USD's orientation is that of the shape's own space, where the volume is measured.
"""

from __future__ import annotations

import numpy as np

from ....arrays import Floats, Ints
from ...resolving.context import Context


def note_inside_out(points: Floats, triangles: Ints, path: str, ctx: Context) -> None:
    """Report closed triangles that run clockwise seen from outside: the volume that they enclose is negative."""
    corners = points[triangles].astype(np.float64) - points[triangles[0, 0]]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
    if volume < 0:
        message = "Light enters it, but its faces look inwards: what is outside counts as its inside."
        ctx.warn("inside-out", path, message, "orientation")


def fans(face_counts: Ints, face_points: Ints) -> Ints:
    """(T, 3) triangles of polygons, from the first corner of each."""
    start, count = np.cumsum(face_counts) - face_counts, np.maximum(face_counts - 2, 0)
    first = np.repeat(start, count)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([face_points[first], face_points[second], face_points[second + 1]], axis=1)
