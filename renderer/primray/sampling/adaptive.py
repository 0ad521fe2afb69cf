"""Adaptive sampling: which tiles get more samples, by their error and the cost of a sample.

Tiles double their samples one after another, always the one whose error falls most for the rays that it takes, so that every
tile's count remains a power of two times the first block's, at which Sobol points are best. With variance v of one sample and c
rays for it, doubling n samples reduces the error by v / 2n for n c rays. Tiles are judged at the anchors of schedule.py; v is
estimated from the difference of the replicates, half of it from the neighbouring tiles, since these may contain samples of
light that the tile's own have missed. It is limited to what would give a tile a quarter to eight times the mean number of
samples, which bounds the effect of wrong estimates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from ..core import TILE, Film

LEAST, MOST = 0.25, 8.0
DOUBLINGS = 4  # of one tile, at most, between two anchors

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Plan:
    """The order in which tiles double their samples, from one anchor to the next."""

    samples: int  # per pixel, on average, at the anchor
    begin: Counts  # samples of a replicate at the anchor, by tile
    order: Counts  # tile indices
    levels: Counts  # how often that tile has doubled before
    spent: Counts  # samples of a replicate, over the whole picture, after each doubling
    pixels: int

    def ends(self, samples: int) -> npt.NDArray[np.uint32]:
        """Return the ends (R, tiles) for a mean not below the anchor's: as many doublings as it allows."""
        each = self.begin << self._doublings(self._steps(samples))
        return np.stack([each, each]).astype(np.uint32)

    def _steps(self, samples: float) -> int:
        allowed = (samples - self.samples) * self.pixels / 2
        return int(np.searchsorted(self.spent, allowed, side="right"))

    def _doublings(self, steps: int) -> Counts:
        return np.bincount(self.order[:steps], minlength=len(self.begin)).astype(np.int64)

    def samples_for(self, tile_errors: Doubles, now: float, part: float, left: float) -> float:
        """Return the mean samples per pixel at which the error has fallen to `part` of its value at `now` samples.

        `tile_errors` are its parts; a tile's error is multiplied by `left` at each doubling. inf if this plan does not get
        there.
        """
        steps = self._steps(now)
        coming, levels = self.order[steps:], self.levels[steps:]
        taken = tile_errors[coming] * left ** (levels - self._doublings(steps)[coming]) * (1 - left)
        enough = np.flatnonzero(np.cumsum(taken) >= (1 - part) * tile_errors.sum())
        return self.samples + 2 * float(self.spent[steps + enough[0]]) / self.pixels if len(enough) else float("inf")


def make_plan(film: Film, tile_errors: Doubles, samples: int, begin: Counts | None = None, doublings: int = DOUBLINGS) -> Plan:
    """Plan further samples for the parts that tiles have in the frame's error at `samples` per pixel, on average.

    `begin`: samples of a replicate that tiles have then, if not those in the film. A tile doubles at most `doublings` times.
    """
    now = film.next[0].astype(np.int64)
    begin = now if begin is None else begin
    pixels = tile_pixels(film)
    variance = _around(tile_errors * begin / pixels, film.tiles)  # variance of one sample of one pixel
    cost = np.maximum(film.tile_rays / np.maximum(2 * now * pixels, 1), 1.0)
    value = variance / cost
    usual = float(np.sqrt(value).mean()) ** 2
    value = np.clip(value, LEAST**2 * usual, MOST**2 * usual) if usual > 0 else np.ones_like(value)
    # Sort all possible doublings by value. Each doubling of a tile is worth a quarter of its previous one.
    counts = begin[None, :] << np.arange(doublings)[:, None]
    order = np.argsort(-(value / counts.astype(np.float64) ** 2).ravel(), kind="stable")
    tiles = order % len(begin)
    spent = np.cumsum(counts.ravel()[order] * pixels[tiles])
    return Plan(samples=samples, begin=begin, order=tiles, levels=order // len(begin), spent=spent, pixels=int(pixels.sum()))


def tile_pixels(film: Film) -> Counts:
    """Return the number of pixels in each tile; tiles at the right and bottom edges are smaller."""
    width, height = film.resolution
    columns, rows = film.tiles
    across = np.minimum(TILE, width - TILE * np.arange(columns))
    down = np.minimum(TILE, height - TILE * np.arange(rows))
    return np.outer(down, across).ravel().astype(np.int64)


def _around(values: Doubles, tiles: tuple[int, int]) -> Doubles:
    """Return each tile's value averaged with the mean of its 3 x 3 neighbourhood."""
    columns, rows = tiles
    grid = np.pad(values.reshape(rows, columns), 1, mode="edge")
    nine = np.zeros((rows, columns))
    for y in range(3):
        for x in range(3):
            nine += grid[y : y + rows, x : x + columns]
    result: Doubles = (0.5 * values.reshape(rows, columns) + 0.5 * nine / 9).ravel()
    return result
