"""Fast cross product of many vectors; numpy's own takes 80 microseconds of overhead per call, which is noticeable per mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def cross(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return a x b for arrays of the same shape (..., 3)."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(a.shape)
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out
