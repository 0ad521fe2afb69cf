"""Adaptive sampling: which tiles get more samples, from where the error is and what a sample costs.

Tiles double their samples one after another, always the one whose error falls most for the rays that it takes, so that every
tile's number stays a power of two times the first block's, at which Sobol points are best. With variance v of one sample and
c rays for it, doubling n samples takes v / 2n off the error for n c rays. Tiles are judged at the anchors of schedule.py; v
is what the replicates' difference says, half of it from the tiles around, since what one tile's samples have missed its
neighbours' may have seen. It is limited to what would give a tile a quarter to eight times the mean number of samples, which
bounds what a wrong judgement can do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..core import TILE, Film

LEAST, MOST = 0.25, 8.0
DOUBLINGS = 4  # of one tile, at most, from one anchor to the next

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Plan:
    """From an anchor to the next: where tiles stand at it, in each replicate, and which double in which order."""

    samples: int  # a pixel, on average, at the anchor
    begin: Counts
    order: Counts  # numbers of tiles
    levels: Counts  # how often that tile has doubled before
    spent: Counts  # samples of a replicate, over the picture, after each doubling
    pixels: int

    def ends(self, samples: int) -> npt.NDArray[np.uint32]:
        """(R, tiles) for a mean not below the anchor's: as many doublings as it allows."""
        each = self.begin << self._doublings(self._steps(samples))
        return np.stack([each, each]).astype(np.uint32)

    def _steps(self, samples: float) -> int:
        allowed = (samples - self.samples) * self.pixels / 2
        return int(np.searchsorted(self.spent, allowed, side="right"))

    def _doublings(self, steps: int) -> Counts:
        return np.bincount(self.order[:steps], minlength=len(self.begin)).astype(np.int64)

    def samples_for(self, tile_errors: Doubles, now: float, part: float, left: float) -> float:
        """Samples a pixel, on average, at which the error has fallen to `part` of what it is with `now` samples.

        `tile_errors` are the parts of that; a tile's is multiplied by `left` each time that it doubles. inf if no doubling of
        this plan gets there.
        """
        steps = self._steps(now)
        coming, levels = self.order[steps:], self.levels[steps:]
        taken = tile_errors[coming] * left ** (levels - self._doublings(steps)[coming]) * (1 - left)
        enough = np.flatnonzero(np.cumsum(taken) >= (1 - part) * tile_errors.sum())
        return self.samples + 2 * float(self.spent[steps + enough[0]]) / self.pixels if len(enough) else float("inf")


def make_plan(film: Film, tile_errors: Doubles, samples: int, begin: Counts | None = None, doublings: int = DOUBLINGS) -> Plan:
    """For the error that each tile has (its part of the frame's) when pixels have `samples` on average.

    `begin`: samples of a replicate that tiles have then, if not what the film has now. A tile doubles as often as `doublings`
    at most.
    """
    now = film.next[0].astype(np.int64)
    begin = now if begin is None else begin
    pixels = tile_pixels(film)
    variance = _around(tile_errors * begin / pixels, film.tiles)  # of one sample of one pixel
    cost = np.maximum(film.tile_rays / np.maximum(2 * now * pixels, 1), 1.0)
    value = variance / cost
    usual = float(np.sqrt(value).mean()) ** 2
    value = np.clip(value, LEAST**2 * usual, MOST**2 * usual) if usual > 0 else np.ones_like(value)
    # Every doubling that may come, the best first; of one tile each is worth a quarter of the one before.
    counts = begin[None, :] << np.arange(doublings)[:, None]
    order = np.argsort(-(value / counts.astype(np.float64) ** 2).ravel(), kind="stable")
    tiles = order % len(begin)
    spent = np.cumsum(counts.ravel()[order] * pixels[tiles])
    return Plan(samples, begin, tiles, order // len(begin), spent, int(pixels.sum()))


def tile_pixels(film: Film) -> Counts:
    """Pixels in each tile; those at the right and bottom are smaller."""
    width, height = film.resolution
    columns, rows = film.tiles
    across = np.minimum(TILE, width - TILE * np.arange(columns))
    down = np.minimum(TILE, height - TILE * np.arange(rows))
    return np.outer(down, across).ravel().astype(np.int64)


def _around(values: Doubles, tiles: tuple[int, int]) -> Doubles:
    """Each tile's value, half of it taken from the nine of which it is the middle."""
    columns, rows = tiles
    grid = np.pad(values.reshape(rows, columns), 1, mode="edge")
    nine = np.zeros((rows, columns))
    for y in range(3):
        for x in range(3):
            nine += grid[y : y + rows, x : x + columns]
    result: Doubles = (0.5 * values.reshape(rows, columns) + 0.5 * nine / 9).ravel()
    return result
