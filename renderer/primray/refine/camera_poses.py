"""Approximation of a moving camera for footprints by a few pieces with fixed orientation and linear translation.

The rotation within a piece is accounted for by a wider window.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Doubles

Window = tuple[float, float, float, float]  # left, right, bottom, top at unit distance

MOST_POSES = 16
TURN = 0.05  # radians from a piece's middle to its ends, small enough not to need more pieces


@dataclass(frozen=True, eq=False)
class Pose:
    camera_from_world: Doubles  # (4, 4) at the start of the piece, with the orientation at its middle
    sweep: Doubles  # (3,) translation of the camera, in its own space

    def distances(self, points: Doubles) -> Doubles:
        """Return the smallest distance (K,) of the camera to points (K, 3) in its own space."""
        return _distances(points, self.sweep)

    def distances_in_world(self, points: Doubles) -> Doubles:
        """Return the smallest distance (K,) of the camera to points (K, 3) in world space."""
        world_from_camera = np.linalg.inv(self.camera_from_world)
        return _distances(points - world_from_camera[:3, 3], world_from_camera[:3, :3] @ self.sweep)


def _distances(points: Doubles, sweep: Doubles) -> Doubles:
    """Return the distance (K,) of points to the segment from the origin to `sweep`."""
    if not sweep.any():
        return np.asarray(np.linalg.norm(points, axis=1))
    along = np.clip(points @ sweep / (sweep @ sweep), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - along[:, None] * sweep, axis=1))


def camera_poses(cameras: Sequence[Doubles]) -> tuple[tuple[Pose, ...], float]:
    """Return the pieces of a path given by its world_from_camera (4, 4) at several times, and the largest rotation to either
    side within a piece, in radians."""
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
    """Return the pose halfway between two: the rotation nearest to the mean of two rotations is the one between them."""
    mean = (a + b) / 2
    u, _, v = np.linalg.svd(mean[:3, :3])
    mean[:3, :3] = u @ v
    return np.asarray(mean)


def _angle(a: Doubles, b: Doubles) -> float:
    """Return the angle between two orientations, in radians."""
    apart = float(np.linalg.norm(a[:3, :3] - b[:3, :3]))
    return 2.0 * float(np.arcsin(min(apart / np.sqrt(8.0), 1.0)))


def widened(window: Window, angle: float) -> Window:
    """Return a window that contains everything the given one sees while the camera turns by up to `angle` in any direction."""
    left, right, bottom, top = window
    # Rotation about the view direction moves corners in proportion to their distance from the axis.
    across = angle * float(np.hypot(1.0, max(abs(bottom), abs(top))))
    up = angle * float(np.hypot(1.0, max(abs(left), abs(right))))
    return _turned(left, -across), _turned(right, across), _turned(bottom, -up), _turned(top, up)


def _turned(slope: float, angle: float) -> float:
    turned = float(np.arctan(slope)) + angle
    return float(np.tan(turned)) if abs(turned) < 1.5 else float(np.sign(turned) * 1e30)
