"""Closed meshes: test whether light can enter a shape, and report shapes whose faces point inwards, so that their interior is
everything outside.

Mirroring transforms do not matter: USD defines orientation in the shape's own space, where the volume is measured.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Ints
from ..scene.context import Context


def is_closed(points: Floats, triangles: Ints) -> bool:
    """Return whether every edge is shared by exactly two triangles that traverse it in opposite directions (a closed
    2-manifold).

    Coincident points count as one, so that meshes with split vertices count as closed.
    """
    _, welded = np.unique(points, axis=0, return_inverse=True)
    t = welded.reshape(-1)[triangles].astype(np.int64)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    if len(edges) == 0:
        return False
    size = int(edges.max()) + 1
    forward = np.sort(edges[:, 0] * size + edges[:, 1])
    backward = np.sort(edges[:, 1] * size + edges[:, 0])
    return bool((forward[1:] != forward[:-1]).all() and (forward == backward).all())


def report_inside_out(points: Floats, triangles: Ints, path: str, ctx: Context) -> None:
    """Report closed triangles that run clockwise seen from outside, recognised by a negative enclosed volume."""
    corners = points[triangles].astype(np.float64) - points[triangles[0, 0]]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
    if volume < 0:
        message = "It transmits light, but its faces point inwards: everything outside counts as its interior."
        ctx.warn("inside-out", path, message, "orientation")


def triangle_fans(face_counts: Ints, face_points: Ints) -> Ints:
    """Return triangle fans (T, 3) of polygons, from the first corner of each."""
    start, count = np.cumsum(face_counts) - face_counts, np.maximum(face_counts - 2, 0)
    first = np.repeat(start, count)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([face_points[first], face_points[second], face_points[second + 1]], axis=1)
