"""Conversion of USD's row-vector matrices to column-vector numpy, in one place."""

from __future__ import annotations

import numpy as np
from pxr import Gf

from ...arrays import Doubles


def matrix(gf: Gf.Matrix4d) -> Doubles:
    """Return the matrix as (4, 4) float64, column-vector."""
    return np.array(gf, np.float64).T.copy()


def square(upper: Doubles) -> Doubles:
    """Return the (4, 4) matrix with these upper three rows."""
    whole = np.empty((4, 4))
    whole[:3], whole[3] = upper, (0.0, 0.0, 0.0, 1.0)
    return whole
