"""Adaptive sampling: how many samples each tile gets, from where the error is and what a sample costs.

The error of a tile falls with its samples as e / n; with a sample there costing c rays, a sum of errors is least for a given
sum of rays where n is proportional to sqrt(e / c) (Lagrange). Tiles are judged at the anchors of sampling.py; e is what the
replicates' difference says, averaged with the tiles around, since what one tile's samples have missed its neighbours may have
seen. No tile gets less than half or more than four times the mean, which bounds what a wrong judgement can do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .core import TILE, Film
from .description import Doubles

LEAST, MOST = 0.5, 4.0
SETTLED = 1e-3  # the scale of the means is found to within this


@dataclass(frozen=True)
class Plan:
    """From an anchor to the next: where tiles' sequences stand at it, in each replicate, and where they are to stand."""

    samples: int  # a pixel, on average, at the anchor
    begin: npt.NDArray[np.int64]
    end: npt.NDArray[np.int64]

    def ends(self, samples: int) -> npt.NDArray[np.uint32]:
        """(R, tiles) for a mean between the anchors: part of the way, the same for every tile."""
        way = min(max(samples - self.samples, 0), self.samples)
        each = self.begin + (self.end - self.begin) * way // self.samples
        return np.stack([each, each]).astype(np.uint32)


def make_plan(film: Film, tile_errors: Doubles, samples: int) -> Plan:
    """Up to twice the samples, for the error that each tile has now (its part of the frame's)."""
    begin = film.next[0].astype(np.int64)
    pixels = tile_pixels(film)
    errors = _around(tile_errors * begin / pixels, film.tiles)  # of one sample a pixel
    cost = np.maximum(film.tile_rays / np.maximum(begin * pixels, 1), 1.0)
    wish = np.sqrt(errors / cost)
    return Plan(samples, begin, _scaled(wish, begin, pixels, samples))


def tile_pixels(film: Film) -> npt.NDArray[np.int64]:
    """Pixels in each tile; those at the right and bottom are smaller."""
    width, height = film.resolution
    columns, rows = film.tiles
    across = np.minimum(TILE, width - TILE * np.arange(columns))
    down = np.minimum(TILE, height - TILE * np.arange(rows))
    return np.outer(down, across).ravel().astype(np.int64)


def _around(values: Doubles, tiles: tuple[int, int]) -> Doubles:
    """Each tile's value, half of it taken from the eight around."""
    columns, rows = tiles
    grid = np.pad(values.reshape(rows, columns), 1, mode="edge")
    nine = sum(grid[y : y + rows, x : x + columns] for y in range(3) for x in range(3))
    result: Doubles = (0.5 * values.reshape(rows, columns) + 0.5 * nine / 9).ravel()
    return result


def _scaled(wish: Doubles, begin: npt.NDArray[np.int64], pixels: npt.NDArray[np.int64], mean: int) -> npt.NDArray[np.int64]:
    """Whole numbers in proportion to `wish` within the limits, none below `begin`, whose mean over pixels is `mean`."""
    if not wish.max() > 0:
        return np.full_like(begin, mean)
    total = mean * int(pixels.sum())
    low, high = 0.0, MOST * mean / float(wish[wish > 0].min())

    def counts(scale: float) -> npt.NDArray[np.int64]:
        limited = np.clip(scale * wish, LEAST * mean, MOST * mean)
        return np.maximum(begin, np.floor(limited).astype(np.int64))

    while high - low > SETTLED * high:
        middle = (low + high) / 2
        if int((counts(middle) * pixels).sum()) > total:
            high = middle
        else:
            low = middle
    return counts(low)
