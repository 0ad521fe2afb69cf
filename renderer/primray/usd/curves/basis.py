"""UsdGeomBasisCurves as Bezier segments by type, basis and wrap, following the schema's text ("Segment Indexing"), and
UsdGeomHermiteCurves, an exact conversion from points and tangents.

The text's validity checks for linear curves ("> 2", "> 3") contradict its own example, [2 3 2 5] and [3 7]; here two vertices
are enough, or three for a periodic curve. For Hermite curves the schema restricts primvars, widths and normals to varying,
uniform and constant; 'vertex' is read as varying.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ..primvars.reading import Sizes
from .curve_set import EVENLY, CurveSet, Ints, ends_of, run_lengths

Mask = npt.NDArray[np.bool_]

BEZIER, BSPLINE, CATMULL_ROM = "bezier", "bspline", "catmullRom"
# Bezier control points of a segment from its four vertices, by basis.
TO_BEZIER: dict[str, Doubles] = {
    BEZIER: np.eye(4),
    BSPLINE: np.array([[1, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6,
    CATMULL_ROM: np.array([[0, 6, 0, 0], [-1, 6, 1, 0], [0, 1, 6, -1], [0, 0, 6, 0]]) / 6,
}


def basis_curves(counts: Ints, points: int, good: Mask, kind: str, basis: str, wrap: str) -> CurveSet:
    """Return the segments of curves with `counts` (C,) vertices each and `points` in all. Curves that are not `good`, or whose
    vertex count does not make whole segments, are not drawn."""
    step = 3 if kind == "cubic" and basis == BEZIER else 1
    pinned = wrap == "pinned" and kind == "cubic" and basis != BEZIER
    closed = wrap == "periodic"
    counts = counts.astype(np.int64)
    starts = np.cumsum(counts) - counts
    authored, fits = _segments(counts, kind == "linear", step, pinned=pinned, closed=closed)
    there = starts + counts <= points
    drawn = np.flatnonzero(fits & there & good)
    segments = authored[drawn]
    sizes = Sizes(len(counts), points, int(authored.sum()), int((authored + (0 if closed else 1)).sum()))
    ends = ends_of(segments, authored, drawn, closed=closed)
    run, within = run_lengths(segments)
    per_segment = 2 if kind == "linear" else 4
    local = within[:, None] * step + np.arange(per_segment)
    count, start = counts[drawn][run, None], starts[drawn][run, None]
    phantoms = None
    if closed:
        corners = start + local % count
    elif pinned:
        local = local - 1
        number = run[:, None]
        before, beyond = points + number, points + len(drawn) + number
        corners = np.where(local < 0, before, np.where(local >= count, beyond, start + local))
        first, last = starts[drawn], starts[drawn] + counts[drawn] - 1
        phantoms = (np.concatenate([first, last]), np.concatenate([first + 1, last - 1]))
    else:
        corners = start + local
    is_linear = kind == "linear"
    return CurveSet(
        sizes=sizes,
        drawn=drawn,
        segments=segments,
        corners=corners,
        to_bezier=EVENLY if is_linear else TO_BEZIER[basis],
        ends=ends,
        closed=closed,
        joined=is_linear or basis == BEZIER,
        pinned=phantoms,
    )


def _segments(counts: Ints, is_linear: bool, step: int, *, pinned: bool, closed: bool) -> tuple[Ints, Mask]:
    """Return the number of segments of each curve, and whether its vertex count is valid."""
    if is_linear:
        return np.maximum(counts - (0 if closed else 1), 0), counts >= (3 if closed else 2)
    if closed:
        return counts // step, (counts >= 3) & (counts % step == 0)
    if pinned:
        return np.maximum(counts - 1, 0), counts >= 2
    return np.maximum((counts - 4) // step + 1, 0), (counts >= 4) & ((counts - 4) % step == 0)


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
