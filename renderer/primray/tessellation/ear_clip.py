"""Triangulation of a polygon that is not convex by ear clipping (Meisters 1975, "Polygons have ears")."""

from __future__ import annotations

import numpy as np

from ..arrays import Doubles, Ints


def ear_clip(polygon: Doubles) -> Ints:
    """Return triangles (n - 2, 3) of vertex indices of a polygon (n, 3), in its winding. Simple planar polygons keep their area
    exactly; others are triangulated, too."""
    n = len(polygon)
    xy = _project(polygon)
    x, y = xy[:, 0].tolist(), xy[:, 1].tolist()
    ring = list(range(n))
    triangles: list[tuple[int, int, int]] = []
    _drop_flat(x, y, ring, triangles, 0, n)
    at = 0
    misses = 0
    while len(ring) > 3:
        m = len(ring)
        at %= m
        a, b, c = ring[at - 1], ring[at], ring[(at + 1) % m]
        if _turn(x, y, a, b, c) > 0 and not _holds_a_vertex(x, y, ring, a, b, c):
            ear = True
        else:
            misses += 1
            ear = misses > m  # no ear: the polygon intersects itself or is flat; clip this corner anyway
        if ear:
            triangles.append((a, b, c))
            del ring[at]
            misses = 0
            _drop_flat(x, y, ring, triangles, at - 1, 2)  # continue after them, so that ears do not all share a vertex
        else:
            at += 1
    triangles.append((ring[0], ring[1], ring[2]))
    return np.array(triangles, np.int32)


def _turn(x: list[float], y: list[float], a: int, b: int, c: int) -> float:
    return (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a])


def _drop_flat(
    x: list[float], y: list[float], ring: list[int], triangles: list[tuple[int, int, int]], at: int, count: int
) -> None:
    """Clip repeated vertices and tips of spikes among the `count` corners from `at` on, and any that result: ears next to them
    would reach outside the polygon."""
    while count > 0 and len(ring) > 3:
        m = len(ring)
        a, b, c = ring[(at - 1) % m], ring[at % m], ring[(at + 1) % m]
        if _turn(x, y, a, b, c) == 0 and _goes_back(x, y, a, b, c):
            triangles.append((a, b, c))
            del ring[at % m]
            at = at % m - 1
            count += 1
        else:
            at += 1
            count -= 1


def _goes_back(x: list[float], y: list[float], a: int, b: int, c: int) -> bool:
    """Return whether b, collinear with a and c, coincides with one of them or is the tip of a spike, so that no area is cut
    off."""
    return (x[b] - x[a]) * (x[c] - x[b]) + (y[b] - y[a]) * (y[c] - y[b]) <= 0


def _holds_a_vertex(x: list[float], y: list[float], ring: list[int], a: int, b: int, c: int) -> bool:
    """Return whether another vertex is inside the triangle or on its edges; vertices that coincide with its corners do not
    count."""
    ax, ay, bx, by, cx, cy = x[a], y[a], x[b], y[b], x[c], y[c]
    left, right = min(ax, bx, cx), max(ax, bx, cx)
    low, high = min(ay, by, cy), max(ay, by, cy)
    for v in ring:
        px, py = x[v], y[v]
        if px < left or px > right or py < low or py > high or v in (a, b, c):
            continue
        if (px, py) in ((ax, ay), (bx, by), (cx, cy)):
            continue
        if (
            (bx - ax) * (py - ay) - (by - ay) * (px - ax) >= 0
            and (cx - bx) * (py - by) - (cy - by) * (px - bx) >= 0
            and (ax - cx) * (py - cy) - (ay - cy) * (px - cx) >= 0
        ):
            return True
    return False


def _project(polygon: Doubles) -> Doubles:
    """Return coordinates (n, 2) in the plane of the polygon's Newell normal, right-handed about it, scaled to about 1."""
    p = polygon - polygon[0]
    p = p / (np.abs(p).max() or 1.0)
    normal = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    plane: Doubles = p[:, [u, v]]
    return plane if normal[axis] >= 0 else plane[:, ::-1]
