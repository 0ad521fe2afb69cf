"""UsdGeomHermiteCurves as Bezier segments, an exact conversion from points and tangents.

The schema restricts primvars, widths and normals to varying, uniform and constant; 'vertex' is read as varying.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Floats
from .basis import BEZIER, Mask, basis_curves
from .curve_set import CurveSet, Ints

THIRD = 1 / 3


def hermite_curves(counts: Ints, points: int, good: Mask) -> CurveSet:
    """Return the layout of values on vertices, which are linear along each segment."""
    return replace(basis_curves(counts, points, good, "linear", BEZIER, "nonperiodic"), joined=False)


def hermite_controls(curves: CurveSet, points: Floats, tangents: Floats) -> Floats:
    """Return control points (3 S + C, 3) from points and tangents (V, 3): P, P + T / 3, P' - T' / 3, P'."""
    first, last = curves.corners[:, 0], curves.corners[:, 1]
    p, t = points.astype(np.float64), tangents.astype(np.float64)
    made = np.stack([p[first], p[first] + t[first] * THIRD, p[last] - t[last] * THIRD, p[last]], axis=1)
    return curves.laid_out(made)
