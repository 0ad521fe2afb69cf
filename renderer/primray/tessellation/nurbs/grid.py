"""Choice of a patch's grid: intervals are halved while an edge across them covers too many pixels and is not flat. Lengths in
pixels are measured as in the core's dicing of cages (core/subdivision/dicing/footprint.hpp)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...arrays import Doubles
from ..footprint import EVERYWHERE, OUTSIDE, Footprint
from .evaluation import Control, Flags, Lines, grid_normals, points_of

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
        seen = [_IntervalSizes.of(control, u, v, footprint, fine) for control in controls]
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
class _IntervalSizes:
    """Largest edge length across each interval, and whether the surface bends there."""

    u: Doubles
    v: Doubles
    bent_u: Flags
    bent_v: Flags

    @staticmethod
    def of(control: Control, u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> _IntervalSizes:
        """Return the measures from the grid's points and those halfway between its lines."""
        rows = max(1, AT_ONCE // (4 * len(u.at)))
        cuts = [*range(0, len(v.at) - 1, rows), len(v.at) - 1]
        parts = [_IntervalSizes._of_rows(control, u, v.part(a, b + 1), footprint, fine) for a, b in pairwise(cuts)]
        return _IntervalSizes(
            np.max([p.u for p in parts], axis=0),
            np.concatenate([p.v for p in parts]),
            np.any([p.bent_u for p in parts], axis=0),
            np.concatenate([p.bent_v for p in parts]),
        )

    @staticmethod
    def _of_rows(control: Control, u: Lines, v: Lines, footprint: Footprint, fine: Fineness) -> _IntervalSizes:
        twice_u, twice_v = _doubled(u), _doubled(v)
        found = control.grid(twice_u.bases(), twice_v.bases())
        points = points_of(found[0])
        long_u = pixels(footprint, points[:, :-1:2], points[:, 2::2]).max(axis=0)
        long_v = pixels(footprint, points[:-1:2], points[2::2]).max(axis=1)
        if fine.flatness == 0:
            return _IntervalSizes(long_u, long_v, np.ones(len(long_u), bool), np.ones(len(long_v), bool))
        normals = grid_normals(control, twice_u, twice_v, found)
        across_u = _bends(points, normals, footprint, fine)
        across_v = _bends(points.swapaxes(0, 1), normals.swapaxes(0, 1), footprint, fine)
        middle, corners = points[1::2, 1::2], points[::2, ::2]
        twist = np.maximum(
            pixels(footprint, middle, (corners[:-1, :-1] + corners[1:, 1:]) / 2),
            pixels(footprint, middle, (corners[1:, :-1] + corners[:-1, 1:]) / 2),
        )
        twisted = (twist > fine.flatness) & u.is_drawn & v.is_drawn[:, None]
        return _IntervalSizes(long_u, long_v, across_u | twisted.any(axis=0), across_v | twisted.any(axis=1))


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


SMALLEST = 1e-300


def pixels(footprint: Footprint, a: Doubles, b: Doubles) -> Doubles:
    """Return the largest number of pixels (...,) that segments from a to b (..., 3) cover in any placement."""
    longest = footprint.density * np.linalg.norm(b - a, axis=-1)
    for view, sweep in zip(footprint.views, footprint.sweeps, strict=True):
        here, there = (points @ view[:, :3].T + view[:, 3] for points in (a, b))
        longest = np.maximum(longest, _lengths_in_view(footprint, here, there, sweep))
    return np.asarray(longest)


def _lengths_in_view(footprint: Footprint, a: Doubles, b: Doubles, sweep: Doubles) -> Doubles:
    camera = footprint.projected
    length = np.linalg.norm(b - a, axis=-1) * camera.pixels_per_unit
    swept = (np.zeros(3), sweep / 2, sweep) if sweep.any() else (np.zeros(3),)
    if not camera.orthographic:
        length = length / np.maximum(np.min([_distance(a - s, b - s) for s in swept], axis=0), SMALLEST)
    if camera.sees_around:
        return np.asarray(length)
    ends = [p - s for s in swept for p in (a, b)]
    left, right, bottom, top = EVERYWHERE if camera.sees_around else camera.window
    depths = [np.ones(p.shape[:-1]) if camera.orthographic else -p[..., 2] for p in ends]
    sides = [
        np.min([left * d - p[..., 0] for p, d in zip(ends, depths, strict=True)], axis=0),
        np.min([p[..., 0] - right * d for p, d in zip(ends, depths, strict=True)], axis=0),
        np.min([bottom * d - p[..., 1] for p, d in zip(ends, depths, strict=True)], axis=0),
        np.min([p[..., 1] - top * d for p, d in zip(ends, depths, strict=True)], axis=0),
        np.zeros(a.shape[:-1]) if camera.orthographic else np.min([-d for d in depths], axis=0),
    ]
    beyond = np.max(sides, axis=0)
    size = max(right - left, top - bottom)
    far = 1.0 if camera.orthographic else np.max([np.linalg.norm(p, axis=-1) for p in ends], axis=0)
    allowed = OUTSIDE * np.maximum(1.0, beyond / np.maximum(size * far, SMALLEST))
    return np.asarray(np.where(beyond > 0, length / allowed, length))


def _distance(a: Doubles, b: Doubles) -> Doubles:
    """Return the distance of segments from the origin."""
    d = b - a
    dd = (d * d).sum(axis=-1)
    t = np.clip(-(a * d).sum(axis=-1) / np.where(dd > 0, dd, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(a + t[..., None] * d, axis=-1))
