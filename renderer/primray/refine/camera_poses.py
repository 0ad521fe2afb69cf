"""A camera's way in a few pieces, on each of which it looks one way and goes straight: how footprints see a camera that moves.

What the camera turns on a piece is made up for by a wider window.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles

Window = tuple[float, float, float, float]  # left, right, bottom, top at unit distance

MOST_POSES = 16
TURN = 0.05  # radians from a piece's middle to its ends that need no more pieces


@dataclass(frozen=True, eq=False)
class Pose:
    camera_from_world: Doubles  # (4, 4) where the piece begins, turned as in its middle
    sweep: Doubles  # (3,) how far the camera goes, in its own space

    def distances(self, points: Doubles) -> Doubles:
        """(K,) how near the camera comes to points (K, 3) of its own space."""
        return _distances(points, self.sweep)

    def distances_in_world(self, points: Doubles) -> Doubles:
        """The same of points of the world."""
        world_from_camera = np.linalg.inv(self.camera_from_world)
        return _distances(points - world_from_camera[:3, 3], world_from_camera[:3, :3] @ self.sweep)


def _distances(points: Doubles, sweep: Doubles) -> Doubles:
    """(K,) of points to the line from the origin to `sweep`."""
    if not sweep.any():
        return np.asarray(np.linalg.norm(points, axis=1))
    along = np.clip(points @ sweep / (sweep @ sweep), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - along[:, None] * sweep, axis=1))


def camera_poses(cameras: Sequence[Doubles]) -> tuple[tuple[Pose, ...], float]:
    """Of a way by its (4, 4) world_from_camera; and by how many radians the camera turns to either side on a piece at most."""
    first = cameras[0]
    if all(np.array_equal(first, other) for other in cameras):
        return (Pose(np.asarray(np.linalg.inv(first), np.float64), np.zeros(3)),), 0.0
    chosen = np.unique(np.round(np.linspace(0, len(cameras) - 1, min(len(cameras), MOST_POSES + 1))).astype(int))
    ends = [(cameras[a], cameras[b]) for a, b in itertools.pairwise(chosen)]
    while 2 * len(ends) <= MOST_POSES and max(_angle(a, b) for a, b in ends) > 2 * TURN:
        ends = [half for a, b in ends for half in ((a, _middle(a, b)), (_middle(a, b), b))]
    return tuple(_pose(a, b) for a, b in ends), max(_angle(a, b) for a, b in ends) / 2


def _pose(start: Doubles, end: Doubles) -> Pose:
    middle = _middle(start, end)
    middle[:3, 3] = start[:3, 3]
    inverse = np.asarray(np.linalg.inv(middle), np.float64)
    return Pose(inverse, inverse[:3, :3] @ (end[:3, 3] - start[:3, 3]))


def _middle(a: Doubles, b: Doubles) -> Doubles:
    """Half way: the rotation nearest to the mean of two is that between them."""
    mean = (a + b) / 2
    u, _, v = np.linalg.svd(mean[:3, :3])
    mean[:3, :3] = u @ v
    return np.asarray(mean)


def _angle(a: Doubles, b: Doubles) -> float:
    """By how much they are turned from each other, in radians."""
    apart = float(np.linalg.norm(a[:3, :3] - b[:3, :3]))
    return 2.0 * float(np.arcsin(min(apart / np.sqrt(8.0), 1.0)))


def widened(window: Window, angle: float) -> Window:
    """So that it holds all that the window does while the camera turns so far to any side."""
    left, right, bottom, top = window
    # A turn about the way that the camera looks moves corners by as much more as they are away from the axis.
    across = angle * float(np.hypot(1.0, max(abs(bottom), abs(top))))
    up = angle * float(np.hypot(1.0, max(abs(left), abs(right))))
    return _turned(left, -across), _turned(right, across), _turned(bottom, -up), _turned(top, up)


def _turned(slope: float, angle: float) -> float:
    turned = float(np.arctan(slope)) + angle
    return float(np.tan(turned)) if abs(turned) < 1.5 else float(np.sign(turned) * 1e30)
