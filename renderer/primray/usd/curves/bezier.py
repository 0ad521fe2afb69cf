"""Layout of many curves as cubic Bezier segments, by type, basis and wrap, with the mapping of values to description.Curves.

A curve of n segments has 3 n + 1 control points and n + 1 segment ends (description.Curves). Curves that cannot be drawn are
left out, so drawn arrays may be shorter than authored ones.

UsdGeomBasisCurves follow the schema's text ("Segment Indexing"); UsdGeomHermiteCurves are converted exactly from points and
tangents. The text's validity checks for linear curves ("> 2", "> 3") contradict its own example, [2 3 2 5] and [3 7]; here two
vertices are enough, or three for a periodic curve. For Hermite curves the schema restricts primvars, widths and normals to
varying, uniform and constant; 'vertex' is read as varying.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ..primvars.reading import Sizes

Ints = npt.NDArray[np.integer[Any]]

BLOCK = 1 << 14  # segments converted at a time, so that what is computed in double stays in the CPU's cache

# Control points of a segment along which a value varies linearly.
EVENLY = np.array([[1.0, 0.0], [2 / 3, 1 / 3], [1 / 3, 2 / 3], [0.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveSet:
    """Drawn curves (C) with their segments (S in all) and the mapping from authored values."""

    sizes: Sizes  # authored sizes: uniform per curve, varying per segment end
    drawn: Ints  # (C,) index of each among the authored curves
    segments: Ints  # (C,) at least 1
    corners: Ints  # (S, k) vertices of each segment, indices into `extended`
    to_bezier: Doubles  # (4, k) or (S, 4, k): control points of a segment from its vertices
    ends: Ints  # (S + C,) index of each drawn segment end among the authored ones
    closed: bool = False
    joined: bool = True
    within: Doubles | None = None  # (S + C,) position of each end between that authored end and the next
    pinned: tuple[Ints, Ints] | None = None  # (P,) each: vertex next to each phantom point, and the vertex before that

    @property
    def first_segments(self) -> Ints:
        """Index of each curve's first segment (C,)."""
        return np.asarray(np.cumsum(self.segments) - self.segments)

    def extended(self, values: Floats) -> Floats:
        """Return the values at vertices, followed by those at the phantom points of pinned curves."""
        if self.pinned is None:
            return values
        at, before = self.pinned
        return np.concatenate([values, 2 * values[at] - values[before]])

    def controls(self, values: Floats) -> Floats:
        """Return values at control points (3 S + C, k) from values at vertices (V, k)."""
        extended = self.extended(values.astype(np.float64, copy=False))
        controls = np.empty((len(self.corners), 4, values.shape[1]), np.float32)
        for first in range(0, len(controls), BLOCK):
            some = slice(first, first + BLOCK)
            weights = self.to_bezier if self.to_bezier.ndim == 2 else self.to_bezier[some]
            controls[some] = np.matmul(weights, extended[self.corners[some]])
        return self.laid_out(controls)

    def at_ends(self, values: Floats) -> Floats:
        """Return values at segment ends (S + C, k) from authored values at segment ends."""
        found = values[self.ends]
        if self.within is None:
            return found
        after = values[np.minimum(self.ends + 1, len(values) - 1)]
        return np.asarray(found + (after - found) * self.within[:, None].astype(np.float32))

    def controls_of_ends(self, ends: Floats) -> Floats:
        """Return values at control points (3 S + C, k) that vary linearly between segment ends (S + C, k)."""
        first = np.arange(int(self.segments.sum())) + np.repeat(np.arange(len(self.segments)), self.segments)
        both = np.stack([ends[first], ends[first + 1]], axis=1).astype(np.float64)
        return self.laid_out(np.matmul(EVENLY, both))

    def laid_out(self, controls: npt.NDArray[np.floating[Any]]) -> Floats:
        """Return control points (3 S + C, k) from four per segment (S, 4, k), of which adjacent segments share one."""
        count, columns = len(controls), controls.shape[2]
        out = np.empty((3 * count + len(self.segments), columns), np.float32)
        at = 3 * np.arange(count) + np.repeat(np.arange(len(self.segments)), self.segments)
        for k in range(3):
            out[at + k] = controls[:, k]
        last = np.cumsum(self.segments) - 1
        out[at[last] + 3] = controls[last, 3]
        if self.closed:
            out[at[last] + 3] = out[at[self.first_segments]]
        return out

    def per_control(self, of_curves: Floats) -> Floats:
        """Return values at control points (3 S + C, k) from values per curve (C, k)."""
        return np.repeat(of_curves, 3 * self.segments + 1, axis=0)


def run_lengths(counts: Ints) -> tuple[Ints, Ints]:
    """Return, for each of sum(counts) elements, the index of its run and its position within the run."""
    runs = np.repeat(np.arange(len(counts)), counts)
    return runs, np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def ends_of(segments: Ints, authored_segments: Ints, drawn: Ints, *, closed: bool) -> Ints:
    """Return the index (S + C,) of each drawn segment end among the authored ones; closed curves end where they begin."""
    per_curve = authored_segments + (0 if closed else 1)
    first = (np.cumsum(per_curve) - per_curve)[drawn]
    run, within = run_lengths(segments + 1)
    if closed:
        within = within % segments[run]
    return np.asarray(first[run] + within)


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
