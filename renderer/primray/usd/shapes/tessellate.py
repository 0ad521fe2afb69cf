"""Tessellation of implicit shapes with exact normals: surfaces of revolution about Z, boxes and planes, rotated to their
axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats, Ints

AROUND = 64
CAP_RINGS = 16  # per quarter circle of a capsule's caps, as fine as the circle around


@dataclass(frozen=True)
class Tessellated:
    points: Floats
    triangles: Ints
    normals: Floats | None  # (3T, 3) per corner; None: flat


def cube(size: float) -> Tessellated:
    h = size / 2
    points = np.array([[x, y, z] for z in (-h, h) for y in (-h, h) for x in (-h, h)], np.float32)
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]], np.int32)
    return Tessellated(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), None)


def plane(width: float, length: float, axis: str) -> Tessellated:
    """Tessellate UsdGeomPlane. For axis Z, width is along X and length along Y; for X, along Z and Y; for Y, along X and Z."""
    w, d = width / 2, length / 2
    corners = {
        "Z": [[-w, -d, 0], [w, -d, 0], [w, d, 0], [-w, d, 0]],
        "Y": [[-w, 0, d], [w, 0, d], [w, 0, -d], [-w, 0, -d]],
        "X": [[0, -d, w], [0, -d, -w], [0, d, -w], [0, d, w]],
    }[axis]
    return Tessellated(np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32), None)


def cone(radius: float, height: float, axis: str) -> Tessellated:
    """Tessellate a cone with its apex on the positive axis and a closed base."""
    h = height / 2
    return revolve([_Band([(radius, -h), (0.0, h)], [(height, radius)] * 2), _cap(radius, -h, -1)], axis)


def cylinder(bottom: float, top: float, height: float, axis: str) -> Tessellated:
    """Tessellate a cylinder with both caps; the radii differ for Cylinder_1."""
    h = height / 2
    side = (height, bottom - top)
    return revolve([_Band([(bottom, -h), (top, h)], [side, side]), _cap(bottom, -h, -1), _cap(top, h, 1)], axis)


def capsule(bottom: float, top: float, height: float, axis: str, low_rings: int = 0, high_rings: int = 0) -> Tessellated:
    """Tessellate UsdGeomCapsule, or Capsule_1 with two radii: the convex hull of spheres at both ends of a spine of length
    `height`.

    If one sphere contains the other, only the larger is made. The caps have as many rings as they need, unless a number is
    given.
    """
    if height < 0:
        bottom, top, height = top, bottom, -height
    wider = bottom - top
    if wider and abs(wider) >= height:
        radius, z = (bottom, -height / 2) if wider > 0 else (top, height / 2)
        return revolve([_arc(radius, z, -math.pi / 2, math.pi / 2)], axis)
    # A line tangent to both circles, and its normals, lean by asin((bottom - top) / height).
    slope = _lean(bottom, top, height)
    low = _arc(bottom, -height / 2, -math.pi / 2, slope, low_rings)
    high = _arc(top, height / 2, slope, math.pi / 2, high_rings)
    side = _Band([low.profile[-1], high.profile[0]], [low.normals[-1], high.normals[0]])
    return revolve([low, side, high], axis)


def cap_rings(bottom: float, top: float, height: float) -> tuple[int, int]:
    """Return the number of rings that a capsule's lower and upper caps need; (0, 0) if one sphere contains the other."""
    if abs(bottom - top) >= abs(height):
        return 0, 0
    slope = _lean(bottom, top, abs(height))
    return _rings(-math.pi / 2, slope), _rings(slope, math.pi / 2)


def _lean(bottom: float, top: float, height: float) -> float:
    return math.asin((bottom - top) / height) if bottom != top else 0.0


def _rings(first: float, last: float) -> int:
    return math.ceil((last - first) / (math.pi / 2) * CAP_RINGS)


def _arc(radius: float, z: float, first: float, last: float, rings: int = 0) -> _Band:
    """Return the band of a sphere about the point z on the axis, between two latitudes in radians."""
    rings = rings or _rings(first, last)
    latitudes = np.linspace(first, last, rings + 1)
    c, s = np.cos(latitudes), np.sin(latitudes)
    c[np.abs(latitudes) == math.pi / 2] = 0.0
    profile = [(float(radius * x), float(z + radius * y)) for x, y in zip(c, s, strict=True)]
    return _Band(profile, [(float(x), float(y)) for x, y in zip(c, s, strict=True)])


@dataclass(frozen=True)
class _Band:
    """Profile of (radius, z) points from bottom to top (top caps: from the outside inwards), with normals (radial, axial) at
    them."""

    profile: list[tuple[float, float]]
    normals: list[tuple[float, float]]


def _cap(radius: float, z: float, side: int) -> _Band:
    profile = [(radius, z), (0.0, z)] if side > 0 else [(0.0, z), (radius, z)]
    return _Band(profile, [(0.0, float(side))] * 2)


def revolve(bands: list[_Band], axis: str) -> Tessellated:
    """Return the surface of revolution of bands about the axis; coincident rings share their points, so that the surface is
    closed."""
    points: list[Doubles] = []
    rings: dict[tuple[float, float], int] = {}  # (radius, z) -> index of its first point
    triangles: list[Ints] = []
    normals: list[Doubles] = []
    phi = 2 * math.pi * np.arange(AROUND) / AROUND
    circle = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    i = np.arange(AROUND)
    j = (i + 1) % AROUND

    def ring(radius: float, z: float) -> Ints:
        key = (float(radius), float(z))
        if key not in rings:
            rings[key] = sum(len(p) for p in points)
            count = 1 if radius == 0 else AROUND
            points.append(np.column_stack([circle[:count] * radius, np.full(count, z)]))
        return rings[key] + (np.zeros(AROUND, np.int32) if radius == 0 else i.astype(np.int32))

    for band in bands:
        for k in range(len(band.profile) - 1):
            lower, upper = ring(*band.profile[k]), ring(*band.profile[k + 1])
            for a, b, c, at in (
                (lower, lower, upper, ((k, i), (k, j), (k + 1, j))),
                (lower, upper, upper, ((k, i), (k + 1, j), (k + 1, i))),
            ):
                corners = np.stack([a[at[0][1]], b[at[1][1]], c[at[2][1]]], axis=1)
                solid = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
                triangles.append(corners[solid])
                n = np.stack([_normals(circle, band.normals[ring_of], around) for ring_of, around in at], axis=1)
                normals.append(n[solid].reshape(-1, 3))
    order = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}[axis]
    return Tessellated(
        np.concatenate(points)[:, order].astype(np.float32),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate(normals)[:, order].astype(np.float32),
    )


def _normals(circle: Doubles, normal: tuple[float, float], around: npt.NDArray[np.integer]) -> Doubles:
    length = math.hypot(*normal) or 1.0
    return np.column_stack([circle[around] * (normal[0] / length), np.full(len(around), normal[1] / length)])
