"""Statistical tests for a change in a region, beyond what noise of any distribution explains.

Every statistic but the last is a sum of t(p) d(p) over the pixels p of a region, with a template t independent of d(p)'s noise.
With V = sum of t^2 (d^2 + 2 (sA^2 + sB^2)) / 3, an unchanged scene has |sum| > x sqrt(V) with a probability of at most
2 exp(-x^2 / 2), without an assumption on the distribution of the noise: for exchangeable replicates because the six equally
likely values of each pixel are strictly sub-Gaussian; for independent noise of known variance by Delyon 2009
("Exponential inequalities for sums of weakly dependent variables": e^(x - x^2/6) <= 1 + x + x^2/3); for repeated random numbers
V is the sum of t^2 d^2 (Efron 1969, "Student's t-test under symmetry conditions"). Heavy tails raise V, not the false alarms.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Doubles
from .difference import ALPHA, Difference, Relation, box_sum, checkerboard, local_precision, shifted_sum

BLOCKS = (4, 8, 16)  # pixels across, aligned to the picture's upper left corner
_BEYOND = 2.0  # factor on the tile's largest noise that a pixel's difference must exceed to be an outlier
_FEWEST = 3  # outliers in a block from which it is tested


@dataclass(frozen=True, eq=False)
class Grid:
    """A picture cut into regions: the first row and column of each."""

    rows: npt.NDArray[np.intp]
    columns: npt.NDArray[np.intp]
    shape: tuple[int, int]  # height and width of the picture

    def sum(self, field: Doubles) -> Doubles:
        return np.add.reduceat(np.add.reduceat(field, self.rows, axis=0), self.columns, axis=1)

    def box(self, y: int, x: int) -> tuple[int, int, int, int]:
        """Return x0, y0, x1, y1 of a region, ends excluded."""
        ends_y, ends_x = [*self.rows[1:], self.shape[0]], [*self.columns[1:], self.shape[1]]
        return int(self.columns[x]), int(self.rows[y]), int(ends_x[x]), int(ends_y[y])


def tiles(shape: tuple[int, int], size: int) -> Grid:
    """Return tiles of at most `size` pixels across, of similar size, aligned to blocks where possible."""
    step = max((block for block in BLOCKS if block < size and size % block == 0), default=1)

    def starts(length: int) -> npt.NDArray[np.intp]:
        count = math.ceil(length / size)
        return np.array([round(length * k / count / step) * step for k in range(count)], np.intp)

    return Grid(starts(shape[0]), starts(shape[1]), shape)


def blocks(shape: tuple[int, int], size: int) -> Grid:
    return Grid(np.arange(0, shape[0], size, dtype=np.intp), np.arange(0, shape[1], size, dtype=np.intp), shape)


def whole(shape: tuple[int, int]) -> Grid:
    return Grid(np.zeros(1, np.intp), np.zeros(1, np.intp), shape)


@dataclass(frozen=True, eq=False)
class Family:
    """One statistic over all regions of a grid and all channels."""

    kind: str  # shift, brightness, moved-x, moved-y, texture-fine, texture-broad, spot
    scale: str  # image, tile, block
    grid: Grid
    log_p: Doubles  # (C, h, w): logarithm of the probability without a change, at most
    size: Doubles  # (C, h, w): relative difference found
    signed: Doubles  # (C, h, w): the difference with its sign, if any: B - A, or pixels to the right or down


@dataclass(frozen=True, eq=False)
class Resolution:
    """The smallest uniform change of every tile that could be seen, as noise over signal, before the threshold."""

    grid: Grid
    noise: Doubles  # (C, h, w): standard error of the relative mean difference
    share_a: Doubles  # (C, h, w): the share of A in its square
    pixels: Doubles  # (h, w): number of judged pixels


def log_p_of(total: Doubles, variance: Doubles) -> Doubles:
    """Return the bound log(2 exp(-x^2/2)) on the log probability, or 0 where it is above 0."""
    square = np.divide(total**2, variance, out=np.zeros_like(total), where=variance > 0)
    return np.minimum(math.log(2.0) - square / 2, 0.0)


def threshold(alpha: float, tests: int) -> float:
    """Return x such that `tests` sums exceed it with a total probability of alpha."""
    return math.sqrt(2 * math.log(2 * tests / alpha))


# Kind, scale and grid of a family, with log_p, size and signed (h, w) of one channel.
Row = tuple[str, str, Grid, Doubles, Doubles, Doubles]


class Tests:
    """All test families of a difference. `tile` is the size of the largest regions below the image."""

    def __init__(self, of: Difference, tile: int) -> None:
        shape = (of.judged.shape[0], of.judged.shape[1])
        self.of = of
        self.image, self.tiles = whole(shape), tiles(shape, tile)
        self.blocks = [blocks(shape, size) for size in BLOCKS if size < tile]
        self._levels = {id(grid): self._level(grid) for grid in (self.image, self.tiles, *self.blocks)}
        self._count = {id(grid): grid.sum(of.judged.astype(np.float64)) for grid in (self.image, self.tiles, *self.blocks)}

    def _level(self, grid: Grid) -> Doubles:
        """Return the RMS brightness of regions, with the floor: the denominator of relative differences."""
        count = grid.sum(self.of.judged.astype(np.float64))
        mean = grid.sum(np.where(self.of.judged, self.of.brightness, 0.0)) / np.maximum(count, 1)
        return np.sqrt(np.maximum(mean, 0.0) + self.of.floor**2)

    def relative(self, value: Doubles, grid: Grid, channel: int) -> Doubles:
        level = np.ones_like(value) if self.of.channels[channel] == ALPHA else self._levels[id(grid)]
        return np.divide(value, level, out=np.where(value != 0, np.inf, 0.0), where=level > 0)

    def run(self) -> tuple[list[Family], Resolution]:
        found: dict[tuple[str, str, int], list[tuple[Doubles, Doubles, Doubles]]] = {}
        grids: dict[tuple[str, str, int], Grid] = {}
        noise, share = [], []
        for channel in range(len(self.of.channels)):
            for kind, scale, grid, *arrays in self._channel(channel):
                key = (kind, scale, id(grid))
                grids[key] = grid
                found.setdefault(key, []).append((arrays[0], arrays[1], arrays[2]))
            tile_noise, tile_share = self._noise(channel)
            noise.append(tile_noise)
            share.append(tile_share)
        families = [
            Family(kind, scale, grids[kind, scale, key], *(np.stack(arrays) for arrays in zip(*rows, strict=True)))
            for (kind, scale, key), rows in found.items()
        ]
        return families, Resolution(self.tiles, np.stack(noise), np.stack(share), self._count[id(self.tiles)])

    def _parts(self, template: Doubles, channel: int, grid: Grid) -> list[Doubles]:
        """Return the terms of V by region: sums of t^2 d^2, t^2 sA^2 and t^2 sB^2."""
        of, square = self.of, template**2
        return [grid.sum(square * part) for part in (of.d[channel] ** 2, of.variance_a[channel], of.variance_b[channel])]

    def _variance(self, d2: Doubles, va: Doubles, vb: Doubles) -> tuple[Doubles, Doubles]:
        """Return V, and the share of A in it."""
        of = self.of
        if of.relation is Relation.UNEQUAL:
            va, vb = _known_by_the_better(va, vb, of.samples)
        share = np.divide(va, va + vb, out=np.full_like(va, 0.5), where=va + vb > 0)
        return (d2 if of.relation is Relation.REPEATED else (d2 + 2 * (va + vb)) / 3), share

    def _tiles_and_image(self, sums: list[Doubles]) -> Iterator[tuple[str, Grid, list[Doubles]]]:
        yield "tile", self.tiles, sums
        yield "image", self.image, [np.array([[part.sum()]]) for part in sums]

    def _channel(self, channel: int) -> Iterator[Row]:
        yield from self._shifts(channel)
        around, precision = local_precision(self.of, channel)
        mean, judged = self.of.mean[channel], self.of.judged
        yield from self._multiples("brightness", around, precision, channel)
        yield from self._multiples("moved-x", _gradient(mean, judged, (0, 1)), precision, channel)
        yield from self._multiples("moved-y", _gradient(mean, judged, (1, 0)), precision, channel)
        yield from self._textures(precision, channel)
        if self.blocks:
            yield self._spots(channel)

    def _shifts(self, channel: int) -> Iterator[Row]:
        """Yield tests of the plain mean difference of regions of every size."""
        d, flat = self.of.d[channel], self.of.judged.astype(np.float64)
        levels = [("tile", self.tiles, [self.tiles.sum(d), *self._parts(flat, channel, self.tiles)])]
        for finer, grid in zip([None, *self.blocks], self.blocks, strict=False):
            if finer is None:
                sums = [grid.sum(d), *self._parts(flat, channel, grid)]
            else:
                sums = [blocks(part.shape, 2).sum(part) for part in levels[-1][2]]
            levels.append(("block", grid, sums))
        for scale, grid, (total, *parts) in levels:
            shift = self.relative(total / np.maximum(self._count[id(grid)], 1), grid, channel)
            yield "shift", scale, grid, log_p_of(total, self._variance(*parts)[0]), np.abs(shift), shift

    def _multiples(self, kind: str, pattern: Doubles, precision: Doubles, channel: int) -> Iterator[Row]:
        """Yield tests for a difference that is a multiple of a pattern: the picture, or its gradient (motion in pixels)."""
        template = pattern * precision
        sums = [
            self.tiles.sum(part) for part in (template * self.of.d[channel], template * pattern, pattern**2 * self.of.judged)
        ]
        for scale, grid, (total, unit, power, *parts) in self._tiles_and_image(
            sums + self._parts(template, channel, self.tiles)
        ):
            factor = np.divide(total, unit, out=np.zeros_like(total), where=unit > 0)
            rms = np.sqrt(power / np.maximum(self._count[id(grid)], 1))
            size = self.relative(np.abs(factor) * rms, grid, channel)
            signed = size * np.sign(factor) if kind == "brightness" else -factor
            yield kind, scale, grid, log_p_of(total, self._variance(*parts)[0]), size, signed

    def _textures(self, precision: Doubles, channel: int) -> Iterator[Row]:
        """Yield tests of the correlation between black checkerboard pixels and nearby white ones: changes of any pattern."""
        d, judged = self.of.d[channel], self.of.judged
        white = checkerboard(d.shape)
        seen = (white & judged).astype(np.float64)
        black = ~white & judged
        unit_sum = self.tiles.sum(precision * black)
        for kind, total_of in (("texture-fine", _next_to), ("texture-broad", box_sum)):
            weight = total_of(seen)
            pattern = np.divide(total_of(seen * d), weight, out=np.zeros_like(d), where=(weight > 0) & black)
            template = pattern * precision
            sums = [self.tiles.sum(template * d), unit_sum, *self._parts(template, channel, self.tiles)]
            for scale, grid, (total, unit, *parts) in self._tiles_and_image(sums):
                power = np.divide(np.maximum(total, 0), unit, out=np.zeros_like(total), where=unit > 0)
                size = self.relative(np.sqrt(power), grid, channel)
                # Only a positive correlation with the neighbourhood counts as a change.
                log_p = np.where(total > 0, log_p_of(total, self._variance(*parts)[0]), 0.0)
                yield kind, scale, grid, log_p, size, size

    def _spots(self, channel: int) -> Row:
        """Test for a few pixels of a block, of one sign, far beyond any noise of their tile.

        This is a rank test: if differences and noise had the same distribution, the k largest of N + k would be these k with
        probability 1 / C(N + k, k). It is the only test that assumes the largest noise values of a tile to be identically
        distributed; the factor _BEYOND is its margin.
        """
        of, grid = self.of, self.blocks[0]
        d, va, vb = of.d[channel], of.variance_a[channel], of.variance_b[channel]
        if of.relation is Relation.UNEQUAL:
            va, vb = _known_by_the_better(va, vb, of.samples)
        noise = np.sqrt(va) + np.sqrt(vb)
        largest = np.maximum.reduceat(np.maximum.reduceat(noise, self.tiles.rows, axis=0), self.tiles.columns, axis=1)
        y = np.searchsorted(self.tiles.rows, np.arange(d.shape[0]), side="right") - 1
        x = np.searchsorted(self.tiles.columns, np.arange(d.shape[1]), side="right") - 1
        beyond = np.abs(d) > _BEYOND * largest[np.ix_(y, x)]
        up, down = grid.sum((beyond & (d > 0)).astype(np.float64)), grid.sum((beyond & (d < 0)).astype(np.float64))
        k = np.maximum(up, down)
        others = self._count[id(self.tiles)][np.ix_(y[grid.rows], x[grid.columns])]
        pixels = self._count[id(grid)]
        log_p, some = np.zeros_like(k), k >= _FEWEST
        if some.any():
            n, k_some = others[some], k[some]
            log_p[some] = _log_choose(pixels[some], k_some) + (1 - k_some) * math.log(2.0) - _log_choose(n + k_some, k_some)
        size = np.sqrt(grid.sum(np.where(beyond, d, 0.0) ** 2) / np.maximum(pixels, 1))
        size = self.relative(size, grid, channel)
        return "spot", "block", grid, np.minimum(log_p, 0), size, np.where(up >= down, size, -size)

    def _noise(self, channel: int) -> tuple[Doubles, Doubles]:
        """Return the standard error of every tile's relative mean difference, and the share of A in its square."""
        variance, share = self._variance(*self._parts(self.of.judged.astype(np.float64), channel, self.tiles))
        mean = np.sqrt(variance) / np.maximum(self._count[id(self.tiles)], 1)
        return self.relative(mean, self.tiles, channel), share


def _next_to(field: Doubles) -> Doubles:
    return shifted_sum(field, [(0, 1), (0, -1), (1, 0), (-1, 0)])


def _known_by_the_better(va: Doubles, vb: Doubles, samples: tuple[float | None, float | None]) -> tuple[Doubles, Doubles]:
    """Return variances with a floor for the image with fewer samples.

    The image with more samples has seen rare bright paths that the other may have missed, so its scaled variance is that floor.
    """
    na, nb = samples
    if na and nb and na < nb:
        return np.maximum(va, vb * (nb / na)), vb
    if na and nb and nb < na:
        return va, np.maximum(vb, va * (na / nb))
    return va, vb


def _gradient(mean: Doubles, judged: npt.NDArray[np.bool_], step: tuple[int, int]) -> Doubles:
    """Return the change of (H, W) per pixel along `step`, by central differences; 0 where a neighbour is missing."""
    dy, dx = step
    both = shifted_sum(judged.astype(np.float64), [(dy, dx), (-dy, -dx)]) == 2
    return np.where(both & judged, (shifted_sum(mean, [(dy, dx)]) - shifted_sum(mean, [(-dy, -dx)])) / 2, 0.0)


def _log_choose(n: Doubles, k: Doubles) -> Doubles:
    lgamma = np.vectorize(math.lgamma, otypes=[float])
    out: Doubles = lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)
    return out
