"""NURBS whose surfaces have closed forms, and a view of them: a camera that looks from far along -z."""

from __future__ import annotations

import numpy as np

from primray.arrays import Doubles
from primray.description import Direction, Mesh, NurbsPatch, TrimCurve
from primray.description.geometry import TrimLoop
from primray.tessellation.footprint import Footprint, Projected
from primray.tessellation.nurbs.patches import DicedPatch, Fineness, dice_patch

HALF = float(np.sqrt(0.5))
# A circle in four quarters, and its right half in two: control points, weights, knots (Piegl and Tiller, 7.3).
CIRCLE = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], float)
CIRCLE_WEIGHTS = np.array([1, HALF] * 4 + [1])
CIRCLE_KNOTS = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], float)
AROUND = Direction(9, 3, CIRCLE_KNOTS, 0.0, 4.0)
ARC, ARC_WEIGHTS = np.array([(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)], float), np.array([1, HALF, 1, HALF, 1])
UP = Direction(5, 3, np.array([0, 0, 0, 1, 1, 2, 2, 2], float), 0.0, 2.0)
STRAIGHT = Direction(2, 2, np.array([0, 0, 1, 1], float), 0.0, 1.0)


def revolved(profile: Doubles, weights: Doubles, along: Direction) -> NurbsPatch:
    """About z, of a profile of (radius, height)."""
    points = np.array([(x * r, y * r, z) for r, z in profile for x, y in CIRCLE], np.float32)
    return NurbsPatch("/p", points, np.outer(weights, CIRCLE_WEIGHTS).ravel(), AROUND, along, 0)


def sphere() -> NurbsPatch:
    return revolved(ARC, ARC_WEIGHTS, UP)


def torus(tube: float) -> NurbsPatch:
    return revolved(np.stack([1 + tube * CIRCLE[:, 0], tube * CIRCLE[:, 1]], axis=1), CIRCLE_WEIGHTS, AROUND)


def cone() -> NurbsPatch:
    return revolved(np.array([(1.0, 0.0), (0.0, 1.0)]), np.ones(2), STRAIGHT)


def plane(*loops: TrimLoop) -> NurbsPatch:
    """The unit square, whose parameters are its coordinates."""
    points = np.array([(x, y, 0) for y in (0, 1) for x in (0, 1)], np.float32)
    return NurbsPatch("/p", points, None, STRAIGHT, STRAIGHT, 0, loops)


def circle(x: float, y: float, radius: float, *, hole: bool = False) -> TrimLoop:
    """Counter-clockwise, or clockwise as holes go."""
    points = np.concatenate([(radius * CIRCLE + (x, y)) * CIRCLE_WEIGHTS[:, None], CIRCLE_WEIGHTS[:, None]], axis=1)
    return (TrimCurve(AROUND, points[::-1].copy() if hole else points),)


def polygon(*corners: tuple[float, float]) -> TrimLoop:
    """Closed, each side a curve."""
    ends = zip(corners, (*corners[1:], corners[0]), strict=True)
    return tuple(TrimCurve(STRAIGHT, np.array([(*a, 1.0), (*b, 1.0)])) for a, b in ends)


def seen(pixels_per_unit: float = 100.0) -> Footprint:
    view = np.eye(4)[:3].copy()
    view[2, 3] = -1000.0
    everywhere = (-1e9, 1e9, -1e9, 1e9)
    return Footprint(Projected((), True, pixels_per_unit, everywhere), view[None], 0.0, np.zeros((1, 3)))


def diced(patch: NurbsPatch, pixels: float = 4.0, footprint: Footprint | None = None, flatness: float = 0.1) -> DicedPatch:
    found = dice_patch(patch, footprint or seen(), Fineness(pixels, flatness, 10))
    assert found is not None
    return found


def areas(mesh: Mesh) -> Doubles:
    """(T, 3) cross products of sides, halved."""
    a, b, c = (mesh.points[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    return np.asarray(np.cross(b - a, c - a) / 2)
