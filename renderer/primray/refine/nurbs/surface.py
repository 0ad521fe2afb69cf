"""Exact evaluation of a patch: points, normals and control-point values, over a grid or at single parameters."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...arrays import Doubles, Floats
from ...description import NurbsPatch
from .basis import Bases, bases
from .lines import Lines

# Offsets for points without a tangent plane, as shares of an interval: the error is of this size times the surface's curvature
# over an interval, plus rounding of 1e-16 divided by it.
INWARD = (2.0**-26, 2.0**-13, 2.0**-5)
LITTLE = 1e-4  # smallest cross product, in units of such a share
NOTHING = 1e-11  # of the product of the largest tangents: smaller cross products count as zero


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
    return _added(terms)


def _added(terms: Iterable[Doubles]) -> Doubles:
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
    bad = length <= NOTHING * scale
    for share in INWARD:
        if not bad.any():
            break
        rows, columns = np.nonzero(bad)
        near_u = bases(u.direction, u.spans[columns], u.inward(share)[columns])
        near_v = bases(v.direction, v.spans[rows], v.inward(share)[rows])
        normals[bad], _ = across(*control.single(near_u, near_v))
        length[bad] = np.linalg.norm(normals[bad], axis=-1)
        bad = length <= LITTLE * share * scale
    normals[length == 0] = 0, 0, 1  # degenerate to a line or point, where nothing is drawn
    return np.asarray(normals / np.where(length > 0, length, 1.0)[..., None])
