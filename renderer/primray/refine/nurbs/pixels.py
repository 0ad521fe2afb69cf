"""Screen size of line segments in pixels, as the core's dicing of cages measures it (core/subdivision/dicing/footprint.hpp)."""

from __future__ import annotations

import numpy as np

from ...arrays import Doubles
from ..footprint import EVERYWHERE, OUTSIDE, Footprint

LEAST = 1e-300


def pixels(footprint: Footprint, a: Doubles, b: Doubles) -> Doubles:
    """Return the largest number of pixels (...,) that segments from a to b (..., 3) cover in any placement."""
    longest = footprint.density * np.linalg.norm(b - a, axis=-1)
    for view, sweep in zip(footprint.views, footprint.sweeps, strict=True):
        here, there = (points @ view[:, :3].T + view[:, 3] for points in (a, b))
        longest = np.maximum(longest, _seen(footprint, here, there, sweep))
    return np.asarray(longest)


def _seen(footprint: Footprint, a: Doubles, b: Doubles, sweep: Doubles) -> Doubles:
    camera = footprint.projected
    length = np.linalg.norm(b - a, axis=-1) * camera.pixels_per_unit
    swept = (np.zeros(3), sweep / 2, sweep) if sweep.any() else (np.zeros(3),)
    if not camera.orthographic:
        length = length / np.maximum(np.min([_distance(a - s, b - s) for s in swept], axis=0), LEAST)
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
    allowed = OUTSIDE * np.maximum(1.0, beyond / np.maximum(size * far, LEAST))
    return np.asarray(np.where(beyond > 0, length / allowed, length))


def _distance(a: Doubles, b: Doubles) -> Doubles:
    """Return the distance of segments from the origin."""
    d = b - a
    dd = (d * d).sum(axis=-1)
    t = np.clip(-(a * d).sum(axis=-1) / np.where(dd > 0, dd, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(a + t[..., None] * d, axis=-1))
