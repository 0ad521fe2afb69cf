"""UsdGeomNurbsCurves as Bezier segments. Non-rational curves of degree up to 3 are converted exactly; in others each knot span
is divided until the error is within TOLERANCE of the curve's size (thousandths of a pixel).

A piece interpolates the curve's points and derivatives at both ends (Hermite). These are linear in the control points, so the
matrices found for the points at the frame also hold for other times, widths and primvars. There are count + order knots, as in
the schema; the upper bound of a range is at most knots[count], where the last span ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles, Floats
from ..primvars.reading import Sizes
from .bezier import CurveSet, Ints, Mask

TOLERANCE = 1e-6
BREAK = 1e-4  # of the curve's size: a knot of full multiplicity may break a curve
MOST_PIECES = 128  # per knot span
HIGHEST_ORDER = 16


@dataclass(frozen=True, eq=False)
class NurbsCurve:
    """A NURBS curve without its control points."""

    order: int
    knots: Doubles  # (n + order,)
    weights: Doubles  # (n,) positive
    low: float  # drawn range, within the knots' domain
    high: float

    @property
    def degree(self) -> int:
        return self.order - 1

    def basis(self, span: int, u: Doubles) -> tuple[Doubles, Doubles]:
        """Return the rational basis functions (m, order) of points span - degree to span at parameters (m,) in this span, and
        their derivatives."""
        low, high = self._polynomials(span, u, self.degree - 1), self._polynomials(span, u, self.degree)
        slopes = np.zeros_like(high)
        for k in range(self.order):
            i = span - self.degree + k
            before, after = self.knots[i + self.degree] - self.knots[i], self.knots[i + self.order] - self.knots[i + 1]
            if k > 0 and before > 0:
                slopes[:, k] += self.degree * low[:, k - 1] / before
            if k < self.degree and after > 0:
                slopes[:, k] -= self.degree * low[:, k] / after
        w = self.weights[span - self.degree : span + 1]
        total, change = (high * w).sum(axis=1, keepdims=True), (slopes * w).sum(axis=1, keepdims=True)
        rational = high * w / total
        return rational, (slopes * w - rational * change) / total

    def _polynomials(self, span: int, u: Doubles, degree: int) -> Doubles:
        """Return the B-spline basis (m, degree + 1), by Piegl and Tiller 1997, "The NURBS Book", algorithm A2.2."""
        values = np.ones((len(u), 1))
        for d in range(1, degree + 1):
            grown = np.zeros((len(u), d + 1))
            for r in range(d):
                left, right = self.knots[span + 1 - d + r], self.knots[span + 1 + r]
                part = values[:, r] / (right - left)
                grown[:, r] += (right - u) * part
                grown[:, r + 1] += (u - left) * part
            values = grown
        return values

    def spans(self) -> list[tuple[int, float, float]]:
        """Return index, first and last parameter of the non-empty knot spans within the range."""
        found = []
        for j in range(self.degree, len(self.weights)):
            a, b = max(float(self.knots[j]), self.low), min(float(self.knots[j + 1]), self.high)
            if b > a:
                found.append((j, a, b))
        return found

    def pieces(self, points: Doubles, tolerance: float) -> tuple[Ints, Doubles, Doubles]:
        """Return for each piece its first point (S,) and its control points as combinations of `order` points (S, 4, order),
        and for each piece end (S + 1,) its position among the values at knots, counted from the start of the domain."""
        firsts, matrices, places = [], [], []
        is_exact = self.degree <= 3 and bool((self.weights == self.weights[0]).all())
        for span, a, b in self.spans():
            own = points[span - self.degree : span + 1]
            count = 1
            while True:
                u = np.linspace(a, b, count + 1)
                made = self._hermite(span, u)
                if is_exact or count >= MOST_PIECES or self._error(span, u, made, own) <= tolerance:
                    break
                count *= 2
            firsts += [span - self.degree] * count
            matrices.append(made)
            at = span - self.degree + (u - self.knots[span]) / (self.knots[span + 1] - self.knots[span])
            places.append(at[:-1] if (span, a, b) != self.spans()[-1] else at)
        return np.array(firsts), np.concatenate(matrices), np.concatenate(places)

    def _hermite(self, span: int, u: Doubles) -> Doubles:
        values, slopes = self.basis(span, u)
        third = (np.diff(u) / 3)[:, None]
        first, last = values[:-1], values[1:]
        return np.stack([first, first + third * slopes[:-1], last - third * slopes[1:], last], axis=1)

    def _error(self, span: int, u: Doubles, made: Doubles, own: Doubles) -> float:
        worst = 0.0
        controls = made @ own
        for t in (0.25, 0.5, 0.75):
            v = 1 - t
            bezier = np.array([v**3, 3 * t * v * v, 3 * t * t * v, t**3])
            true = self.basis(span, u[:-1] * v + u[1:] * t)[0] @ own
            worst = max(worst, float(np.abs(np.einsum("k,skc->sc", bezier, controls) - true).max()))
        return worst


def nurbs_curves(
    counts: Ints, points: Floats, good: Mask, orders: Ints, knots: Doubles, ranges: Doubles | None, weights: Doubles | None
) -> CurveSet:
    """Return the segments of curves with `counts` points each. Curves with unusable order, knots, range or weights, or broken
    by their knots, are not drawn."""
    starts = np.cumsum(counts) - counts
    known = np.zeros(len(counts), np.int64)
    known[: len(orders)] = orders[: len(counts)]
    ends = np.maximum(counts - known + 2, 0)
    first_end, first_knot = np.cumsum(ends) - ends, np.cumsum(counts + known) - (counts + known)
    drawn, segments, corners, matrices, at = [], [], [], [], []
    for c in np.flatnonzero(good).tolist():
        order, count, start = int(known[c]), int(counts[c]), int(starts[c])
        own = knots[first_knot[c] : first_knot[c] + count + order]
        of_range = None if ranges is None or c >= len(ranges) else ranges[c]
        w = np.ones(count) if weights is None else weights[start : start + count]
        curve = _valid_curve(order, count, own, of_range, w)
        if curve is None or start + count > len(points):
            continue
        mine = points[start : start + count].astype(np.float64)
        size = float(np.ptp(mine, axis=0).max())
        first, made, places = curve.pieces(mine - mine[0], TOLERANCE * size)
        at_ends = np.einsum("sek,skc->sec", made[:, [0, 3]], mine[first[:, None] + np.arange(order)])
        if np.abs(at_ends[1:, 0] - at_ends[:-1, 1]).max(initial=0.0) > BREAK * size:
            continue
        drawn.append(c)
        segments.append(len(first))
        corners.append(start + first[:, None] + np.arange(order))
        matrices.append(made)
        at.append(first_end[c] + places)
    widest = max((m.shape[2] for m in matrices), default=1)
    places = np.concatenate(at) if at else np.zeros(0)
    last = (first_end + ends - 1)[np.repeat(drawn, np.array(segments, np.int64) + 1)] if drawn else np.zeros(0, np.int64)
    whole = np.minimum(np.floor(places).astype(np.int64), np.maximum(last - 1, 0))
    return CurveSet(
        sizes=Sizes(len(counts), len(points), 0, int(ends.sum())),
        drawn=np.array(drawn, np.int64),
        segments=np.array(segments, np.int64),
        corners=np.concatenate([_padded(c, widest) for c in corners]) if corners else np.zeros((0, 1), np.int64),
        to_bezier=np.concatenate([np.pad(m, ((0, 0), (0, 0), (0, widest - m.shape[2]))) for m in matrices])
        if matrices
        else np.zeros(0),
        ends=whole,
        within=places - whole,
    )


def _valid_curve(order: int, count: int, knots: Doubles, asked: Doubles | None, weights: Doubles) -> NurbsCurve | None:
    if not (2 <= order <= min(count, HIGHEST_ORDER)) or len(knots) != count + order or len(weights) != count:
        return None
    if not (np.isfinite(knots).all() and (np.diff(knots) >= 0).all() and np.isfinite(weights).all() and (weights > 0).all()):
        return None
    low, high = float(knots[order - 1]), float(knots[count])
    if asked is not None and np.isfinite(asked).all() and asked[0] < asked[1]:
        low, high = max(low, float(asked[0])), min(high, float(asked[1]))
    return NurbsCurve(order, knots, weights, low, high) if high > low else None


def _padded(corners: Ints, widest: int) -> Ints:
    """Return the point indices padded with the last one, whose weight is 0."""
    return np.concatenate([corners, np.repeat(corners[:, -1:], widest - corners.shape[1], axis=1)], axis=1)
