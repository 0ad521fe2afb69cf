"""USD's row-vector matrices to column-vector numpy, once, and the products that flattening needs."""

from __future__ import annotations

import numpy as np
from pxr import Gf

from ..description import Doubles


def matrix(gf: Gf.Matrix4d) -> Doubles:
    """(4, 4) float64, column-vector convention."""
    return np.array(gf, np.float64).T.copy()


def rows(gf_matrices: list[Gf.Matrix4d]) -> Doubles:
    """(K, 3, 4): the upper three rows of each."""
    stacked = np.array([np.array(gf, np.float64) for gf in gf_matrices]).reshape(-1, 4, 4)
    return np.ascontiguousarray(stacked.transpose(0, 2, 1)[:, :3, :])


def square(upper: Doubles) -> Doubles:
    """(4, 4) from the upper three rows."""
    return np.vstack([upper, (0.0, 0.0, 0.0, 1.0)])


def rotations(quaternions: Doubles) -> Doubles:
    """(K, 3, 3) from (K, 4) quaternions x, y, z, w (USD arrays' memory order), made unit length; zero ones turn nothing."""
    q = quaternions.astype(np.float64)
    length = np.linalg.norm(q, axis=1)
    q = np.where((length > 0)[:, None], q / np.where(length > 0, length, 1.0)[:, None], (0.0, 0.0, 0.0, 1.0))
    x, y, z, w = q.T
    r = np.empty((len(q), 3, 3))
    r[:, 0, 0], r[:, 0, 1], r[:, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    r[:, 1, 0], r[:, 1, 1], r[:, 1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    r[:, 2, 0], r[:, 2, 1], r[:, 2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return r


def compose_into(out: Doubles, outer: Doubles, inner: Doubles) -> None:
    """out (N * K, 3, 4) = every outer (N, 3, 4) after every inner (K, 3, 4), outer slowest; in blocks, to bound memory."""
    n, k = len(outer), len(inner)
    if n == 0 or k == 0:
        return
    columns = inner.transpose(1, 0, 2).reshape(3, k * 4)
    result = out.reshape(n, k, 3, 4)
    step = max(1, 100_000 // k)
    for start in range(0, n, step):
        block = outer[start : start + step]
        product = (block[:, :, :3].reshape(-1, 3) @ columns).reshape(len(block), 3, k, 4)
        result[start : start + step] = product.transpose(0, 2, 1, 3)
        result[start : start + step, :, :, 3] += block[:, None, :, 3]
