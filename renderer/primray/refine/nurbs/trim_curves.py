"""Trim curves as closed polylines in a patch's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles
from ...description import Direction, TrimCurve
from ...description.nurbs import TrimLoop
from .basis import Indices, bases, spans_of

MOST_PARTS = 1 << 12  # per span of a curve
# Shares of the patch, different for u and v so that a diagonal through the grid's crossings stays off them.
EDGE, AWAY = 1e-9, (1.37e-11, 0.83e-11)
BELOW, ABOVE = (1.0, 0.71), (0.83, 0.59)  # of EDGE
NO_AREA = 1e-12


@dataclass(frozen=True)
class Tolerance:
    """Allowed error of a polyline in pixels, and pixels per unit of each parameter."""

    pixels: float
    per_u: float
    per_v: float


def flattened(loop: TrimLoop, tolerance: Tolerance) -> Doubles:
    """Return points (K, 2) on the curves of a loop, without a repeated last one."""
    found = np.concatenate([_flat(curve, tolerance) for curve in loop])
    return np.asarray(found[(found != np.roll(found, 1, axis=0)).any(axis=1)])


def _flat(curve: TrimCurve, tolerance: Tolerance) -> Doubles:
    basis = curve.basis
    spans, knots = spans_of(basis), basis.knots
    low, high = np.maximum(knots[spans], basis.low), np.minimum(knots[spans + 1], basis.high)
    parts: Indices = np.full(len(spans), 1 if basis.order == 2 else 4, np.intp)
    for _ in range(3):
        points, span = _sampled(curve, spans, low, high, 2 * parts)
        off = _off(points, span, parts, tolerance)
        more = np.ceil(np.sqrt(off / tolerance.pixels)).astype(np.intp)
        if (more <= 1).all():
            break
        parts = np.minimum(parts * np.maximum(more, 1), MOST_PARTS)
    return _sampled(curve, spans, low, high, parts)[0]


def _sampled(curve: TrimCurve, spans: Indices, low: Doubles, high: Doubles, parts: Indices) -> tuple[Doubles, Indices]:
    """Return each span divided into `parts` plus the last point, with the index of each point's span."""
    of = np.repeat(np.arange(len(spans)), parts)
    within = np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)
    at = low[of] + (high[of] - low[of]) * within / parts[of]
    at, of = np.append(at, high[-1]), np.append(of, len(spans) - 1)
    b = bases(curve.basis, spans[of], at)
    found = np.add.reduce([b.values[:, k, None] * curve.points[b.first + k] for k in range(curve.basis.order)])
    return np.asarray(found[:, :2] / found[:, 2:]), of


def _off(points: Doubles, of: Indices, parts: Indices, tolerance: Tolerance) -> Doubles:
    """Return the largest distance in pixels, by span, of every second point from the line between its neighbours."""
    scale = np.array([tolerance.per_u, tolerance.per_v])
    off = np.linalg.norm((points[1::2] - (points[:-1:2] + points[2::2]) / 2) * scale, axis=1)
    found = np.zeros(len(parts))
    np.maximum.at(found, of[1::2], off)
    return found


def start_of(curve: TrimCurve) -> Doubles:
    return _at(curve, curve.basis.low, 0)


def end_of(curve: TrimCurve) -> Doubles:
    return _at(curve, curve.basis.high, -1)


def _at(curve: TrimCurve, parameter: float, span: int) -> Doubles:
    """Return the point (2,) at the curve's beginning or end."""
    b = bases(curve.basis, spans_of(curve.basis)[[span]], np.array([parameter]))
    found = b.values[0] @ curve.points[b.first[0] : b.first[0] + curve.basis.order]
    return np.asarray(found[:2] / found[2])


def area(loop: Doubles) -> float:
    """Return the signed area, positive for counter-clockwise loops."""
    x, y = (loop - loop[:1]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2


def off_the_grid(loop: Doubles, u: Direction, v: Direction) -> Doubles:
    """Return the loop moved imperceptibly, so that it passes through no crossing of the grid's lines; what runs along the
    patch's edge is moved beyond it."""
    out = loop.copy()
    for axis, direction in enumerate((u, v)):
        size = direction.high - direction.low
        x = loop[:, axis]
        out[:, axis] = x + AWAY[axis] * size
        out[np.abs(x - direction.low) <= EDGE * size, axis] = direction.low - BELOW[axis] * EDGE * size
        out[np.abs(x - direction.high) <= EDGE * size, axis] = direction.high + ABOVE[axis] * EDGE * size
    return out


def encloses(loop: Doubles, point: Doubles) -> bool:
    a, b = loop - point, np.roll(loop, -1, axis=0) - point
    crossing = (a[:, 1] > 0) != (b[:, 1] > 0)
    a, b = a[crossing], b[crossing]
    x = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool(np.count_nonzero(x > 0) % 2)


def are_holes(loops: Sequence[Doubles]) -> bool:
    """Return whether all outermost loops run clockwise; then they are holes in the whole patch, since the kept part is on the
    left of curves."""
    outer = [
        loop
        for k, loop in enumerate(loops)
        if sum(encloses(other, loop[0]) for j, other in enumerate(loops) if j != k) % 2 == 0
    ]
    return bool(loops) and all(area(loop) < 0 for loop in outer)


def has_area(loop: Doubles, u: Direction, v: Direction) -> bool:
    return len(loop) > 2 and abs(area(loop)) > NO_AREA * (u.high - u.low) * (v.high - v.low)
