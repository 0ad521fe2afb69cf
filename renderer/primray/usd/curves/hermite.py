"""UsdGeomHermiteCurves: points and tangents to Bezier segments, exactly.

The text restricts primvars, widths and normals to varying, uniform and constant; what is 'vertex' is read as varying.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Floats
from .basis import BEZIER, Mask, basis_curves
from .curve_set import CurveSet, Ints

THIRD = 1 / 3


def hermite_curves(counts: Ints, points: int, good: Mask) -> CurveSet:
    """Where values on vertices stand, which are linear along each segment."""
    return replace(basis_curves(counts, points, good, "linear", BEZIER, "nonperiodic"), joined=False)


def hermite_controls(curves: CurveSet, points: Floats, tangents: Floats) -> Floats:
    """(3 S + C, 3) of points and tangents (V, 3): P, P + T / 3, P' - T' / 3, P'."""
    first, last = curves.corners[:, 0], curves.corners[:, 1]
    p, t = points.astype(np.float64), tangents.astype(np.float64)
    made = np.stack([p[first], p[first] + t[first] * THIRD, p[last] - t[last] * THIRD, p[last]], axis=1)
    return curves.laid_out(made)
