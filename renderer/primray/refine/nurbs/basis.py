"""B-spline bases and their derivatives at many parameters in double precision (Piegl and Tiller, "The NURBS Book", 2.2 and
2.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles
from ...description import Direction

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
