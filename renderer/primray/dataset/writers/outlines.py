"""Outlines of masks as one closed polygon each: parts and holes are joined by seams, which enclose nothing.

Pixels that share only a corner are parts of their own. An outline is a quarter of a pixel inside its pixels' edges. Filled
exactly, it holds the middles of these pixels and of no others. Filled as cv2.fillPoly does, which cuts coordinates off to whole
numbers and fills the pixels that an outline touches, it holds the same ones, and those under seams.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles

INSET = 0.25  # pixels
SEAM_WINDOW = 8192  # corners, above a ring, among which its seam ends at the nearest
Ring = npt.NDArray[np.int64]  # (N, 2) x and y of corners of pixels; the mask is to the right of each step (y points down)
_STEPS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])  # each is a turn to the right of the one before
_TURNS = (1, 0, 3)  # to the right, which stays with the pixel where two pixels share only the corner; ahead; to the left


def polygon_of(mask: npt.NDArray[np.bool_]) -> Doubles:
    """Return the outline (N, 2) of a mask (H, W) in pixels from its upper left corner; (0, 2) for an empty one."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return np.zeros((0, 2))
    rings = rings_of(mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
    polygon: Doubles = _joined([_inset(ring) for ring in rings]) + np.array([columns[0], rows[0]], np.float64)
    return polygon


def rings_of(mask: npt.NDArray[np.bool_]) -> list[Ring]:
    """Return the outlines of a mask's parts and holes, the upper ones first; those of holes run the other way round."""
    inside = np.pad(np.asarray(mask, bool), 1)
    ahead_of = [
        inside[1:, 1:] & ~inside[:-1, 1:],  # from corners to the right: the pixel below the step is in, the one above is not
        inside[1:, :-1] & ~inside[1:, 1:],  # down
        inside[:-1, :-1] & ~inside[1:, :-1],  # to the left
        inside[:-1, 1:] & ~inside[:-1, :-1],  # up
    ]
    steps = {(y, x, way): None for way, each in enumerate(ahead_of) for y, x in np.argwhere(each).tolist()}
    rings = []
    for first in sorted(steps):
        if first not in steps:
            continue
        corners, step = list[tuple[int, int]](), first
        while step in steps:
            del steps[step]
            y, x, way = step
            y, x = y + int(_STEPS[way][1]), x + int(_STEPS[way][0])
            step = next((after for turn in _TURNS if (after := (y, x, (way + turn) % 4)) in steps), first)
            if step[2] != way:
                corners.append((x, y))
        rings.append(np.array(corners, np.int64))
    return rings


def _inset(ring: Ring) -> Doubles:
    """Return a ring's corners moved into the mask."""
    steps = np.sign(np.roll(ring, -1, axis=0) - ring)
    inward = np.stack([-steps[:, 1], steps[:, 0]], axis=1)
    moved: Doubles = ring + INSET * (inward + np.roll(inward, 1, axis=0))
    return moved


def _joined(rings: list[Doubles]) -> Doubles:
    """Return one polygon of all rings: from each a seam leads to the nearest corner of the rings above, and back."""
    corners, ends = np.concatenate(rings), np.cumsum([len(ring) for ring in rings])
    below: dict[int, list[int]] = {}  # by the corner where seams begin: the corners where they end
    for start, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        above = max(start - SEAM_WINDOW, 0)
        apart = ((corners[start:end, None] - corners[None, above:start]) ** 2).sum(axis=2)
        own, other = divmod(int(apart.argmin()), start - above)
        below.setdefault(above + other, []).append(start + own)
    first = np.concatenate([[0], ends[:-1]])
    order, left = list[int](), [(0, 0)]
    while left:
        corner, done = left.pop()
        order.append(corner)
        ring = int(np.searchsorted(ends, corner, side="right"))
        if done < 0:  # back from a seam
            continue
        size = int(ends[ring] - first[ring])
        if done < size:
            left.append((int(first[ring] + (corner - first[ring] + 1) % size), done + 1))
            for end in below.get(corner, ()):
                left += [(corner, -1), (end, 0)]
    return corners[order[:-1]]  # a polygon closes by itself
