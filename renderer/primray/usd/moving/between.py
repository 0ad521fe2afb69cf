"""Interpolation of matrices between two times as the core does it (description/motion.py), for many at once.

A matrix is decomposed into a rotation and a symmetric stretch (polar decomposition). For mirroring matrices the rotation is
that of the matrix times -1, and the stretch is negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ...description.placement import put_rotations

FLAT = 1e-9  # of the largest stretch: below, the rotation is undefined


@dataclass(frozen=True, eq=False)
class Turned:
    """Polar decomposition of K matrices."""

    quaternions: Doubles  # (K, 4): x, y, z, w
    stretches: Doubles  # (K, 3, 3), symmetric
    translations: Doubles  # (K, 3)


def have_rotations(matrices: Doubles) -> bool:
    """Return whether all matrices (S + 1, K, 3, 4) have well-defined rotations, and none changes between mirroring and not
    mirroring."""
    linear = matrices[..., :3]
    sizes = np.linalg.svd(linear, compute_uv=False)
    if not (sizes[..., 2] > FLAT * sizes[..., 0]).all():
        return False
    mirrors = np.linalg.det(linear) < 0
    return bool((mirrors == mirrors[:1]).all())


def taken_apart(matrices: Doubles) -> Turned:
    """Return the polar decomposition of matrices (K, 3, 4) that have rotations."""
    u, sizes, v = np.linalg.svd(matrices[:, :, :3])
    rotations = u @ v
    signs = np.sign(np.linalg.det(rotations))
    stretches = v.transpose(0, 2, 1) @ (sizes[:, :, None] * v) * signs[:, None, None]
    return Turned(quaternions(rotations * signs[:, None, None]), stretches, matrices[:, :, 3])


def turned(a: Turned, b: Turned, u: float) -> Doubles:
    """Return matrices (K, 3, 4) between two: rotations turn the shorter way at constant speed, the rest is linear."""
    rotations = rotation_matrices(slerp(a.quaternions, b.quaternions, u))
    linear = rotations @ (a.stretches + u * (b.stretches - a.stretches))
    return np.concatenate([linear, (a.translations + u * (b.translations - a.translations))[:, :, None]], axis=2)


def slerp(a: Doubles, b: Doubles, u: float) -> Doubles:
    """Return unit quaternions (K, 4) between `a` and `b`, the shorter way."""
    cosines = np.sum(a * b, axis=1)
    b = np.where(cosines[:, None] < 0, -b, b)
    # The half-angle formula is exact for small angles, too.
    angles = 2.0 * np.arctan2(np.linalg.norm(b - a, axis=1), np.linalg.norm(b + a, axis=1))
    sines = np.sin(angles)
    small = sines < 1e-9
    safe = np.where(small, 1.0, sines)
    from_a = np.where(small, 1.0 - u, np.sin((1.0 - u) * angles) / safe)
    from_b = np.where(small, u, np.sin(u * angles) / safe)
    mixed = from_a[:, None] * a + from_b[:, None] * b
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def angles_between(a: Doubles, b: Doubles) -> Doubles:
    """Return the angles (K,) between rotations given as quaternions, in radians."""
    b = np.where(np.sum(a * b, axis=1)[:, None] < 0, -b, b)
    return np.asarray(4.0 * np.arctan2(np.linalg.norm(b - a, axis=1), np.linalg.norm(b + a, axis=1)))


def quaternions(r: Doubles) -> Doubles:
    """Return quaternions (K, 4) of rotation matrices (K, 3, 3), by the largest component to avoid cancellation (Shepperd
    1978)."""
    trace = np.trace(r, axis1=1, axis2=2)
    diagonal = r[:, [0, 1, 2], [0, 1, 2]]
    found = np.empty((4, len(r), 4))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[i][:, i] = 1.0 - trace + 2.0 * diagonal[:, i]
        found[i][:, j] = r[:, j, i] + r[:, i, j]
        found[i][:, k] = r[:, k, i] + r[:, i, k]
        found[i][:, 3] = r[:, k, j] - r[:, j, k]
        found[3][:, i] = r[:, k, j] - r[:, j, k]
    found[3][:, 3] = 1.0 + trace
    largest = np.argmax(np.concatenate([diagonal, trace[:, None]], axis=1), axis=1)
    chosen = found[largest, np.arange(len(r))]
    return np.asarray(chosen / np.linalg.norm(chosen, axis=1, keepdims=True))


def rotation_matrices(q: Doubles) -> Doubles:
    """Return rotation matrices (K, 3, 3) of unit quaternions."""
    made = np.empty((len(q), 3, 3))
    put_rotations(made, q, 2.0)
    return made
