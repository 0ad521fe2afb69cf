"""Choice of a patch's grid: intervals are halved while an edge across them covers too many pixels and is not flat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...arrays import Doubles
from ..footprint import Footprint
from .lines import Flags, Lines
from .pixels import pixels
from .surface import Control, grid_normals, points_of

MOST_POINTS = 1 << 24  # examined per patch: about four million cells
AT_ONCE = 1 << 20
STRAIGHT = float(np.cos(np.radians(1.0)))  # cosine between normals of what counts as flat


@dataclass(frozen=True)
class Fineness:
    pixels: float  # largest edge length
    flatness: float  # largest deviation of flat intervals, in pixels; 0: none count as flat
    levels: int  # number of times an interval may be halved


@dataclass(frozen=True, eq=False)
class Grid:
    u: Lines
    v: Lines
    per_u: float  # largest number of pixels per unit of each parameter
    per_v: float
    is_limited: bool  # edges are longer than requested


def grid_of(controls: Sequence[Control], u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> Grid | None:
    """Return the grid for `controls`, the control points at each time; None if it would have too many points."""
    for level in range(fine.levels + 1):
        if 4 * len(u.at) * len(v.at) > MOST_POINTS:
            return None
        seen = [_Seen.of(control, u, v, footprint, fine) for control in controls]
        long_u, long_v = (np.max(lengths, axis=0) for lengths in zip(*((s.u, s.v) for s in seen), strict=True))
        bent_u, bent_v = (np.any(flags, axis=0) for flags in zip(*((s.bent_u, s.bent_v) for s in seen), strict=True))
        split_u, split_v = (long_u > fine.pixels) & bent_u & u.is_drawn, (long_v > fine.pixels) & bent_v & v.is_drawn
        is_done = not (split_u.any() or split_v.any())
        if is_done or level == fine.levels:
            return Grid(u, v, _rate(long_u, u), _rate(long_v, v), not is_done)
        u, v = u.split(split_u), v.split(split_v)
    return None


def _rate(lengths: Doubles, lines: Lines) -> float:
    steps = np.diff(lines.at)
    drawn = lines.is_drawn
    return float((lengths[drawn] / steps[drawn]).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _Seen:
    """Largest edge length across each interval, and whether the surface bends there."""

    u: Doubles
    v: Doubles
    bent_u: Flags
    bent_v: Flags

    @staticmethod
    def of(control: Control, u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> _Seen:
        """Return the measures from the grid's points and those halfway between its lines."""
        rows = max(1, AT_ONCE // (4 * len(u.at)))
        cuts = [*range(0, len(v.at) - 1, rows), len(v.at) - 1]
        parts = [_Seen._of_rows(control, u, v.part(a, b + 1), footprint, fine) for a, b in pairwise(cuts)]
        return _Seen(
            np.max([p.u for p in parts], axis=0),
            np.concatenate([p.v for p in parts]),
            np.any([p.bent_u for p in parts], axis=0),
            np.concatenate([p.bent_v for p in parts]),
        )

    @staticmethod
    def _of_rows(control: Control, u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> _Seen:
        twice_u, twice_v = _doubled(u), _doubled(v)
        found = control.grid(twice_u.bases(), twice_v.bases())
        points = points_of(found[0])
        long_u = pixels(footprint, points[:, :-1:2], points[:, 2::2]).max(axis=0)
        long_v = pixels(footprint, points[:-1:2], points[2::2]).max(axis=1)
        if fine.flatness == 0:
            return _Seen(long_u, long_v, np.ones(len(long_u), bool), np.ones(len(long_v), bool))
        normals = grid_normals(control, twice_u, twice_v, found)
        across_u = _bends(points, normals, footprint, fine)
        across_v = _bends(points.swapaxes(0, 1), normals.swapaxes(0, 1), footprint, fine)
        middle, corners = points[1::2, 1::2], points[::2, ::2]
        twist = np.maximum(
            pixels(footprint, middle, (corners[:-1, :-1] + corners[1:, 1:]) / 2),
            pixels(footprint, middle, (corners[1:, :-1] + corners[:-1, 1:]) / 2),
        )
        twisted = (twist > fine.flatness) & u.is_drawn & v.is_drawn[:, None]
        return _Seen(long_u, long_v, across_u | twisted.any(axis=0), across_v | twisted.any(axis=1))


def _doubled(lines: Lines) -> Lines:
    """Return the lines with one more in every interval, drawn or not."""
    where = np.arange(len(lines.at) - 1)
    return lines.with_lines(where, (lines.at[:-1] + lines.at[1:]) / 2)


def _bends(points: Doubles, normals: Doubles, footprint: Footprint, fine: Fineness) -> Flags:
    """Return the mask (M - 1,) of bent intervals along the second axis, where every other column is a line."""
    a, b, middle = points[:, :-1:2], points[:, 2::2], points[:, 1::2]
    off = pixels(footprint, middle, (a + b) / 2) > fine.flatness
    m, n = normals[:, 1::2], (normals[:, :-1:2], normals[:, 2::2])
    turned = np.logical_or.reduce([(m * each).sum(axis=-1) < STRAIGHT for each in n])
    return np.asarray((off | turned).any(axis=0))
