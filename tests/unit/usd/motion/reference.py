"""The seam's motion evaluated as description/motion.py says, by other means than the product: USD's own quaternions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pxr import Gf

from primray.arrays import Doubles, Floats
from primray.description import Instances, MovingInstances, PointMotion, SceneDescription
from primray.description.motion import MatrixMotion, segment_of


def matrices_at(level: MovingInstances, fraction: float) -> Doubles:
    """(K, 4, 4)."""
    k, u = segment_of(level.times, fraction)
    return np.stack([between(a, b, u, level.turns) for a, b in zip(level.matrices[k], level.matrices[k + 1], strict=True)])


def matrix_at(motion: MatrixMotion, fraction: float) -> Doubles:
    """(4, 4)."""
    k, u = segment_of(motion.times, fraction)
    return between(motion.matrices[k, :3], motion.matrices[k + 1, :3], u, motion.turns)


def between(a: Doubles, b: Doubles, u: float, turns: bool) -> Doubles:
    """(4, 4) of two (3, 4)."""
    found = np.eye(4)
    if not turns:
        found[:3] = (1 - u) * a + u * b
        return found
    (ra, sa), (rb, sb) = _polar(a[:, :3]), _polar(b[:, :3])
    rotation = np.array(Gf.Matrix3d(Gf.Slerp(u, _quaternion(ra), _quaternion(rb)))).T
    found[:3, :3] = rotation @ ((1 - u) * sa + u * sb)
    found[:3, 3] = (1 - u) * a[:, 3] + u * b[:, 3]
    return found


def points_at(motion: PointMotion, fraction: float) -> Floats:
    k, u = segment_of(motion.times, fraction)
    return np.asarray((1 - u) * motion.points[k] + u * motion.points[k + 1])


def _polar(m: Doubles) -> tuple[Doubles, Doubles]:
    """By Newton's iteration (Higham 1986); a mirroring is in the stretch."""
    r = m / np.cbrt(abs(np.linalg.det(m)))
    for _ in range(60):
        r = (r + np.linalg.inv(r).T) / 2
    if np.linalg.det(r) < 0:
        r = -r
    return r, r.T @ m


def _quaternion(r: Doubles) -> Gf.Quatd:
    return Gf.Matrix3d(*r.T.ravel().tolist()).ExtractRotation().GetQuat()


def world_at(d: SceneDescription, path: str, fraction: float) -> list[Doubles]:
    """Where a shape stands: (4, 4) world_from_object of each of its instances, at a fraction of the span."""
    numbers = {k for k, shape in enumerate(d.shapes) if shape.path == path}
    found = [placed.matrix for placed in d.static if placed.shape in numbers]
    for placement in d.placements:
        for placed in d.prototypes[placement.prototype].shapes:
            if placed.shape in numbers:
                found += [row @ placed.matrix for row in _product(placement.levels, fraction)]
    return found


def _product(levels: Sequence[Instances], fraction: float) -> list[Doubles]:
    rows = [np.eye(4)]
    for level in levels:
        if isinstance(level, MovingInstances):
            inner = list(matrices_at(level, fraction))
        else:
            inner = [np.vstack([row, (0, 0, 0, 1)]) for row in level.rows(0, len(level))]
        rows = [a @ b for a in rows for b in inner]
    return rows
