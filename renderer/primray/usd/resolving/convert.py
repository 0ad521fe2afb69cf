"""USD's row-vector matrices to column-vector numpy, once."""

from __future__ import annotations

import numpy as np
from pxr import Gf

from ...arrays import Doubles


def matrix(gf: Gf.Matrix4d) -> Doubles:
    """(4, 4) float64, column-vector convention."""
    return np.array(gf, np.float64).T.copy()


def square(upper: Doubles) -> Doubles:
    """(4, 4) from the upper three rows."""
    whole = np.empty((4, 4))
    whole[:3], whole[3] = upper, (0.0, 0.0, 0.0, 1.0)
    return whole
