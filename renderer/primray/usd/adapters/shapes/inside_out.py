"""Detection of closed, light-transmitting shapes whose faces point inwards, so that their interior is everything outside.

Mirroring transforms do not matter: USD defines orientation in the shape's own space, where the volume is measured.
"""

from __future__ import annotations

import numpy as np

from ....arrays import Floats, Ints
from ...scene.context import Context


def note_inside_out(points: Floats, triangles: Ints, path: str, ctx: Context) -> None:
    """Report closed triangles that run clockwise seen from outside, recognised by a negative enclosed volume."""
    corners = points[triangles].astype(np.float64) - points[triangles[0, 0]]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
    if volume < 0:
        message = "It transmits light, but its faces point inwards: everything outside counts as its interior."
        ctx.warn("inside-out", path, message, "orientation")


def fans(face_counts: Ints, face_points: Ints) -> Ints:
    """Return triangle fans (T, 3) of polygons, from the first corner of each."""
    start, count = np.cumsum(face_counts) - face_counts, np.maximum(face_counts - 2, 0)
    first = np.repeat(start, count)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([face_points[first], face_points[second], face_points[second + 1]], axis=1)
