"""Boundaries of volumes, moved inwards by a little more than rays are offset at surfaces.

Of surfaces in one place, a ray hits one. A volume that fills a room would hide its walls, and one that touches another would
hide that one's boundary, were they not apart; volumes in one place have different distances.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Doubles, Floats, Ints
from ..description import Surface

INSET = 2.0**-19  # of the largest coordinate, from the origin of the core's space; twice the ray offset of such a surface
KINDS = 4  # of distances


def volume_insets(surfaces: Sequence[Surface]) -> Doubles:
    """Return by surface the inset of the volume that it bounds, in multiples of the largest coordinate; 0 for others."""
    insets = np.zeros(len(surfaces))
    volumes = [i for i, s in enumerate(surfaces) if s.volume is not None and not s.interface]
    insets[volumes] = [INSET * (1 + number % KINDS) for number in range(len(volumes))]
    return insets


def inset_points(points: Floats, triangles: Ints, inset: Doubles, world_from_object: Doubles, center: Doubles) -> Floats:
    """Return the points of a mesh with those of volumes' triangles moved inwards; `inset` (T,) is by triangle."""
    rows = triangles[inset > 0]
    linear, origin = world_from_object[:3, :3], world_from_object[:3, 3]
    world = points.astype(np.float64) @ linear.T + (origin - center)
    corners = world[rows]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = np.zeros_like(world)
    for k in range(3):
        np.add.at(outwards, rows[:, k], normals)
    lengths = np.linalg.norm(outwards, axis=1)
    used = np.flatnonzero(lengths > 0)
    reach = float(np.abs(world[np.unique(rows)]).max(initial=0.0))
    mirrored = -1.0 if np.linalg.det(linear) < 0 else 1.0
    step = outwards[used] / lengths[used, None] * (-mirrored * reach * float(inset.max()))
    try:
        moved = points.astype(np.float64)
        moved[used] += step @ np.linalg.inv(linear).T
    except np.linalg.LinAlgError:
        return points
    return np.ascontiguousarray(moved, np.float32)


def inset_radius(radius: float, inset: float, world_from_object: Doubles, center: Doubles) -> float:
    """Return the radius of a sphere whose surface bounds a volume."""
    widest = float(np.linalg.norm(world_from_object[:3, :3], axis=0).max())
    reach = float(np.abs(world_from_object[:3, 3] - center).max()) + abs(radius) * widest
    return radius if not widest > 0 else float(np.sign(radius)) * max(abs(radius) - reach * inset / widest, 0.5 * abs(radius))
