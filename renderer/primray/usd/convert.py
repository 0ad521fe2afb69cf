"""USD's row-vector matrices to column-vector numpy, once."""

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


def squares(gf_matrices: list[Gf.Matrix4d]) -> Doubles:
    """(K, 4, 4)."""
    return np.ascontiguousarray(np.array(gf_matrices, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1))


def square(upper: Doubles) -> Doubles:
    """(4, 4) from the upper three rows."""
    return np.vstack([upper, (0.0, 0.0, 0.0, 1.0)])
