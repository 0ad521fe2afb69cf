"""Exact evaluation of a NURBS patch in double precision: B-spline bases and their derivatives, the parameter lines of a grid,
and points, normals and control-point values over a grid or at single parameters.

Bases follow Piegl and Tiller, "The NURBS Book", 2.2 and 2.3. At a possible edge of the surface (a knot of full multiplicity,
where tangents may differ) a grid has two lines at one parameter, each with its own side's tangents; nothing is drawn between
them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats
from ...description import Direction, NurbsPatch

# Offsets for points without a tangent plane, as shares of an interval: the error is of this size times the surface's curvature
# over an interval, plus rounding of 1e-16 divided by it.
INWARD = (2.0**-26, 2.0**-13, 2.0**-5)
NEARLY_DEGENERATE = 1e-4  # smallest cross product, in units of such a share
DEGENERATE = 1e-11  # of the product of the largest tangents: smaller cross products count as zero


@dataclass(frozen=True, eq=False)
class Control:
    """Control points of a patch in homogeneous coordinates (V, U, C), with the weight in the last column."""

    rows: Doubles

    @staticmethod
    def of(patch: NurbsPatch, points: Floats | Doubles) -> Control:
        """Return homogeneous rows of `points` (N, C), any values per control point."""
        w = np.ones(len(points)) if patch.weights is None else patch.weights
        rows = np.concatenate([points.astype(np.float64) * w[:, None], w[:, None]], axis=1)
        return Control(rows.reshape(patch.v.count, patch.u.count, -1))

    def grid(self, u: Bases, v: Bases) -> tuple[Doubles, Doubles, Doubles]:
        """Return homogeneous values (Mv, Mu, C) and their derivatives by u and v over a grid."""
        along, along_u = (_sum(self.rows, u.first, b, axis=1) for b in (u.values, u.slopes))
        return (
            _sum(along, v.first, v.values, axis=0),
            _sum(along_u, v.first, v.values, axis=0),
            _sum(along, v.first, v.slopes, axis=0),
        )

    def values(self, u: Bases, v: Bases) -> Doubles:
        """Return values (Mv, Mu, C - 1) over a grid."""
        found = _sum(_sum(self.rows, u.first, u.values, axis=1), v.first, v.values, axis=0)
        return np.asarray(found[..., :-1] / found[..., -1:])

    def single(self, u: Bases, v: Bases) -> tuple[Doubles, Doubles, Doubles]:
        """Return homogeneous values (M, C) and their derivatives by u and v at pairs of parameters."""
        shape = len(u.first), self.rows.shape[2]
        found, by_u, by_v = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        for j in range(v.values.shape[1]):
            for i in range(u.values.shape[1]):
                rows = self.rows[v.first + j, u.first + i]
                found += (u.values[:, i] * v.values[:, j])[:, None] * rows
                by_u += (u.slopes[:, i] * v.values[:, j])[:, None] * rows
                by_v += (u.values[:, i] * v.slopes[:, j])[:, None] * rows
        return found, by_u, by_v


def _sum(rows: Doubles, first: np.ndarray[tuple[int], np.dtype[np.intp]], weights: Doubles, axis: int) -> Doubles:
    """Return the sum over non-zero basis functions along an axis."""
    shape = [1, 1, 1]
    shape[axis] = len(first)
    terms = (np.take(rows, first + k, axis=axis) * weights[:, k].reshape(shape) for k in range(weights.shape[1]))
    return _sum_of(terms)


def _sum_of(terms: Iterable[Doubles]) -> Doubles:
    found: Doubles | None = None
    for term in terms:
        found = term if found is None else found + term
    assert found is not None
    return found


def points_of(found: Doubles) -> Doubles:
    return np.asarray(found[..., :-1] / found[..., -1:])


def across(found: Doubles, by_u: Doubles, by_v: Doubles) -> tuple[Doubles, Doubles]:
    """Return the cross product of the tangents, and that of their largest lengths."""
    w = found[..., -1:]
    p = found[..., :-1] / w
    along_u = (by_u[..., :-1] - by_u[..., -1:] * p) / w
    along_v = (by_v[..., :-1] - by_v[..., -1:] * p) / w
    lengths = np.linalg.norm(along_u, axis=-1).max(initial=0) * np.linalg.norm(along_v, axis=-1).max(initial=0)
    return np.cross(along_u, along_v), np.asarray(lengths)


def grid_normals(control: Control, u: Lines, v: Lines, found: tuple[Doubles, Doubles, Doubles]) -> Doubles:
    """Return unit normals (Mv, Mu, 3); at poles the limit along each line, of which a cone's tip has many. `found` is the
    result of `control.grid`."""
    normals, scale = across(*found)
    length = np.linalg.norm(normals, axis=-1)
    bad = length <= DEGENERATE * scale
    for share in INWARD:
        if not bad.any():
            break
        rows, columns = np.nonzero(bad)
        near_u = bases(u.direction, u.spans[columns], u.inward(share)[columns])
        near_v = bases(v.direction, v.spans[rows], v.inward(share)[rows])
        normals[bad], _ = across(*control.single(near_u, near_v))
        length[bad] = np.linalg.norm(normals[bad], axis=-1)
        bad = length <= NEARLY_DEGENERATE * share * scale
    normals[length == 0] = 0, 0, 1  # degenerate to a line or point, where nothing is drawn
    return np.asarray(normals / np.where(length > 0, length, 1.0)[..., None])


Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Bases:
    """Basis functions at M parameters in given knot spans; at a knot the span selects one of the two sides."""

    first: Indices  # (M,) index of the first control point with a non-zero basis function
    values: Doubles  # (M, order)
    slopes: Doubles  # (M, order), derivatives by the parameter


def bases(direction: Direction, spans: Indices, at: Doubles) -> Bases:
    """Return the bases; `spans` are indices k of non-empty [knots[k], knots[k + 1]]."""
    knots, degree = direction.knots, direction.order - 1
    values = np.ones((len(at), 1))
    lower = values
    for d in range(1, degree + 1):
        lower, values = values, _raised(values, knots, spans, at, d)
    slopes = np.zeros_like(values)
    for r in range(degree):
        rate = degree * lower[:, r] / (knots[spans + r + 1] - knots[spans + r + 1 - degree])
        slopes[:, r] -= rate
        slopes[:, r + 1] += rate
    return Bases(spans - degree, values, slopes)


def _raised(values: Doubles, knots: Doubles, spans: Indices, at: Doubles, degree: int) -> Doubles:
    """Return the bases of degree `degree` from those of one degree less."""
    out = np.zeros((len(at), degree + 1))
    for r in range(degree):
        right, left = knots[spans + r + 1], knots[spans + r + 1 - degree]
        share = values[:, r] / (right - left)
        out[:, r] += (right - at) * share
        out[:, r + 1] += (at - left) * share
    return out


def spans_of(direction: Direction) -> Indices:
    """Return the knot spans that are drawn and not empty, ascending."""
    knots = direction.knots
    k = np.arange(direction.order - 1, direction.count)
    low, high = np.maximum(knots[k], direction.low), np.minimum(knots[k + 1], direction.high)
    return np.asarray(k[low < high])


Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Lines:
    direction: Direction
    at: Doubles  # (M,)
    spans: Indices  # (M,) span of a line and of the interval after it
    starts: Flags  # (M,) first line of a smooth piece
    joined: Flags  # (M,) first line of a piece that is connected to the line before

    @property
    def is_drawn(self) -> Flags:
        """Mask of drawn intervals (M - 1,)."""
        return ~self.starts[1:]

    def split(self, intervals: Flags) -> Lines:
        """Return the lines with one more in the middle of each of the intervals (M - 1,)."""
        where = np.flatnonzero(intervals)
        return self.with_lines(where, (self.at[where] + self.at[where + 1]) / 2)

    def with_lines(self, intervals: Indices, at: Doubles) -> Lines:
        """Return the lines with further ones `at` parameters in `intervals`; both ascend."""
        place = intervals + 1
        return Lines(
            self.direction,
            np.insert(self.at, place, at),
            np.insert(self.spans, place, self.spans[intervals]),
            np.insert(self.starts, place, False),
            np.insert(self.joined, place, False),
        )

    def part(self, first: int, end: int) -> Lines:
        rows = slice(first, end)
        return Lines(self.direction, self.at[rows], self.spans[rows], self.starts[rows], self.joined[rows])

    def bases(self) -> Bases:
        return bases(self.direction, self.spans, self.at)

    def inward(self, share: float) -> Doubles:
        """Return the parameters, with those at ends of pieces moved inwards by a share of the adjacent interval."""
        moved = self.at.copy()
        ends = np.append(self.starts[1:], True)
        first, last = np.flatnonzero(self.starts[:-1]), np.flatnonzero(ends)
        moved[first] += share * (self.at[first + 1] - self.at[first])
        moved[last] -= share * (self.at[last] - self.at[last - 1])
        return moved


def first_lines(direction: Direction) -> Lines:
    """Return the initial lines, enough to detect how the surface bends."""
    spans, knots = spans_of(direction), direction.knots
    parts = max(1, 2 * (direction.order - 2))
    at, span_of, starts, joined = list[float](), list[int](), list[bool](), list[bool]()
    for k in spans.tolist():
        low, high = max(float(knots[k]), direction.low), min(float(knots[k + 1]), direction.high)
        times = int(np.count_nonzero(knots == knots[k]))
        is_edge = not at or times >= direction.order - 1
        if is_edge and at:  # end of the previous piece, with its tangents
            at.append(low)
            span_of.append(span_of[-1])
            starts.append(False)
            joined.append(False)
        for part in range(parts):
            at.append(low + (high - low) * part / parts)
            span_of.append(k)
            starts.append(is_edge and part == 0)
            joined.append(is_edge and part == 0 and len(at) > 1 and times < direction.order)
    at.append(min(float(knots[spans[-1] + 1]), direction.high))
    return Lines(
        direction,
        np.array(at),
        np.array([*span_of, span_of[-1]], np.intp),
        np.array([*starts, False]),
        np.array([*joined, False]),
    )
