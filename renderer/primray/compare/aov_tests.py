"""Comparison of AOVs, tile by tile like the picture.

Means of samples are tested with their standard errors, like the picture; Cryptomattes by the coverage of each name, with the
largest noise possible for its number of samples; ids by their names. All others are exact, so every difference counts.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..aovs import CRYPTOMATTES, light_path_of
from ..arrays import Doubles
from ..errors import SettingsError
from ..images.aov import Aov, Values
from ..images.exr_parts import MADE_OF_PICTURE, read_aovs
from ..images.reading import MeasuredImage
from .comparison import AovComparison, AovTile, Comparison, Tile, Verdict, compare
from .difference_tests import Grid, threshold, tiles

ALL = "all"
OF_THE_RENDER = frozenset({"samples"})  # cost of the render, not a property of the scene
UNMEASURED = "is noisy but has no standard errors: render it with --aov-errors"
_FLOOR = 0.1  # times the median magnitude: the smallest value that differences are taken relative to


@dataclass(frozen=True)
class Judging:
    """Criteria of a comparison."""

    alpha: float
    tolerance: float
    tile: int


Both = tuple[Mapping[str, Aov], Mapping[str, Aov]]
Pictures = tuple[MeasuredImage, MeasuredImage]


def aovs_in(path: str | os.PathLike[str]) -> dict[str, Aov]:
    """Return the AOVs of an EXR, without pictures derived from the record."""
    return {name: aov for name, aov in read_aovs(path).items() if aov.source not in MADE_OF_PICTURE}


def names_in(both: Both, asked: Iterable[str]) -> tuple[list[str], list[str]]:
    """Return the names to compare, and notes on the rest. SettingsError for a requested name that one picture lacks."""
    asked = list(dict.fromkeys(asked))
    common = [name for name in both[0] if name in both[1] and both[0][name].source not in OF_THE_RENDER]
    if asked != [ALL]:
        for which, there in zip("AB", both, strict=True):
            for name in asked:
                if name not in there:
                    has = f"it has {', '.join(there)}" if there else "it has none"
                    raise SettingsError(f"{which} has no AOV {name}; {has}", where="aovs", code="image-channels")
                if _is_unmeasured(there[name]):
                    sentence = f"the AOV {name} of {which} {UNMEASURED}"
                    raise SettingsError(sentence, where="aovs", code="image-channels")
        return asked, []
    alone = [(name, which) for which, own, other in (("A", *both), ("B", *both[::-1])) for name in own if name not in other]
    notes = [f"the AOV {name} is only in {which}" for name, which in alone]
    unmeasured = [name for name in common if _is_unmeasured(both[0][name]) or _is_unmeasured(both[1][name])]
    notes += [f"the AOV {name} {UNMEASURED}" for name in unmeasured]
    return [name for name in common if name not in unmeasured], notes


def _is_unmeasured(aov: Aov) -> bool:
    return light_path_of(aov.source) is not None and aov.errors is None


def compare_with_aovs(
    pictures: Pictures, both: Both, asked: Iterable[str], *, alpha: float, tolerance: float, tile: int, allow_bias: bool = False
) -> Comparison:
    """Compare pictures and AOVs.

    The verdict is changed if any of them has changed, undecided if any is undecided. Noisy AOVs share the false-alarm rate with
    the picture. SettingsError if they cannot be compared.
    """
    names, notes = names_in(both, asked)
    noisy = sum(1 for name in names if _is_noisy(both[0][name]) or _is_noisy(both[1][name]))
    judging = Judging(alpha / (1 + noisy), tolerance, tile)
    result = compare(*pictures, alpha=judging.alpha, tolerance=tolerance, tile=tile, allow_bias=allow_bias)
    found = tuple(_compared(name, (both[0][name], both[1][name]), pictures, judging) for name in names)
    verdicts = {result.verdict, *(one.verdict for one in found)}
    worst = next(verdict for verdict in (Verdict.CHANGED, Verdict.UNDECIDED, Verdict.UNCHANGED) if verdict in verdicts)
    same = result.identical and all(one.identical for one in found)
    return replace(result, verdict=worst, alpha=alpha, aovs=found, identical=same, notes=(*result.notes, *notes))


def _is_noisy(aov: Aov) -> bool:
    return aov.errors is not None or aov.source in CRYPTOMATTES


def _compared(name: str, pair: tuple[Aov, Aov], pictures: Pictures, judging: Judging) -> AovComparison:
    a, b = pair
    identical = _are_same(a, b)
    if a.source in CRYPTOMATTES or b.source in CRYPTOMATTES:
        return AovComparison(name, "coverage", *_by_coverage(a, b, pictures, judging), identical)
    if a.ids or b.ids:
        return AovComparison(name, "names", *_by_names(a, b, judging), identical)
    if a.values.shape != b.values.shape:
        sentence = f"the AOV {name} has {a.values.shape[2]} channels in A and {b.values.shape[2]} in B"
        raise SettingsError(sentence, where="aovs", code="image-channels")
    if a.errors is None and b.errors is None:
        return AovComparison(name, "values", *_by_values(a, b, judging), identical)
    measured = [_measured(name, aov, picture) for aov, picture in zip(pair, pictures, strict=True)]
    found = compare(measured[0], measured[1], alpha=judging.alpha, tolerance=judging.tolerance, tile=judging.tile)
    return AovComparison(name, "errors", found.verdict, tuple(_tile(tile) for tile in found.tiles), identical)


def _are_same(a: Aov, b: Aov) -> bool:
    """Return whether values and names are identical, bit for bit."""
    if a.values.shape != b.values.shape or dict(a.ids) != dict(b.ids):
        return False
    return bool(np.array_equal(a.values, b.values, equal_nan=a.values.dtype.kind == "f"))


def _tile(tile: Tile) -> AovTile:
    size = tile.finding.relative if tile.verdict is Verdict.CHANGED and tile.finding is not None else abs(tile.relative)
    return AovTile(tile.box, tile.verdict, size)


def _measured(name: str, aov: Aov, picture: MeasuredImage) -> MeasuredImage:
    """Return an AOV as a picture of three channels; channels are repeated if it has fewer."""
    chosen = (0, min(1, len(aov.channels) - 1), min(2, len(aov.channels) - 1))
    own = {"samples_per_pixel": f"{aov.samples} {aov.samples}", "settings.seed": "of AOVs"}
    return MeasuredImage(
        pixels=np.asarray(aov.values[..., chosen], np.float32),
        alpha=None,
        stderr=None if aov.errors is None else np.asarray(aov.errors[..., chosen], np.float32),
        metadata=picture.metadata if aov.samples is None else own,
        name=f"{picture.name} {name}",
        chromaticities=picture.chromaticities,
        frame=picture.frame,
    )


def _by_values(a: Aov, b: Aov, judging: Judging) -> tuple[Verdict, tuple[AovTile, ...]]:
    """Compare exact values by the RMS of the difference over the RMS of the values.

    Values finite in only one picture count as fully different.
    """
    one, two = a.values.astype(np.float64), b.values.astype(np.float64)
    finite = np.isfinite(one) & np.isfinite(two)
    with np.errstate(invalid="ignore"):
        apart = ~finite & ~((one == two) | (np.isnan(one) & np.isnan(two)))
    one, two = np.where(finite, one, 0.0), np.where(finite, two, 0.0)
    grid = tiles(one.shape[:2], judging.tile)
    count = grid.sum(finite.sum(axis=2).astype(np.float64))
    power = grid.sum(((one**2 + two**2) / 2).sum(axis=2)) / np.maximum(count, 1)
    sizes = np.abs(one[finite])
    floor = _FLOOR * float(np.median(sizes[sizes > 0])) if (sizes > 0).any() else 1.0
    square = grid.sum(((one - two) ** 2).sum(axis=2)) / (power + floor**2) + grid.sum(apart.sum(axis=2).astype(np.float64))
    relative = np.sqrt(square / np.maximum(grid.sum(np.full(one.shape[:2], float(one.shape[2]))), 1))
    return _by_size(grid, relative, judging)


def _by_names(a: Aov, b: Aov, judging: Judging) -> tuple[Verdict, tuple[AovTile, ...]]:
    """Compare ids by the share of pixels that show something else."""
    both = np.stack([a.values[..., 0].astype(np.int64), b.values[..., 0].astype(np.int64)], axis=2)
    pairs, place = np.unique(both.reshape(-1, 2), axis=0, return_inverse=True)
    differ = np.array([_name(a, one) != _name(b, two) for one, two in pairs.tolist()])
    grid = tiles(both.shape[:2], judging.tile)
    pixels = grid.sum(np.ones(both.shape[:2]))
    return _by_size(grid, grid.sum(differ[place].reshape(both.shape[:2]).astype(np.float64)) / pixels, judging)


def _name(aov: Aov, number: int) -> str:
    return aov.ids.get(number, f"number {number}") if number else ""


def _by_size(grid: Grid, relative: Doubles, judging: Judging) -> tuple[Verdict, tuple[AovTile, ...]]:
    """Return the verdicts of exact values, where no difference is noise."""
    changed = (relative > 0) & (relative >= judging.tolerance)
    return _told(grid, changed, np.zeros(changed.shape, bool), relative)


def _told(
    grid: Grid, changed: npt.NDArray[np.bool_], unsure: npt.NDArray[np.bool_], size: Doubles
) -> tuple[Verdict, tuple[AovTile, ...]]:
    rows = []
    for y, x in np.ndindex(*changed.shape):
        verdict = Verdict.CHANGED if changed[y, x] else Verdict.UNDECIDED if unsure[y, x] else Verdict.UNCHANGED
        rows.append(AovTile(grid.box(y, x), verdict, float(size[y, x])))
    whole = Verdict.CHANGED if changed.any() else Verdict.UNDECIDED if unsure.any() else Verdict.UNCHANGED
    return whole, tuple(rows)


def _by_coverage(a: Aov, b: Aov, pictures: Pictures, judging: Judging) -> tuple[Verdict, tuple[AovTile, ...]]:
    """Compare Cryptomattes by each name's mean coverage of a tile.

    The coverage by n independent samples has variance c (1 - c) / n, with c moved slightly away from 0 and 1 as by Agresti and
    Coull (1998); stratified samples have less.
    """
    shape = a.values.shape[:2]
    grid = tiles(shape, judging.tile)
    rows = np.searchsorted(grid.rows, np.arange(shape[0]), side="right") - 1
    columns = np.searchsorted(grid.columns, np.arange(shape[1]), side="right") - 1
    tile = rows[:, None] * len(grid.columns) + columns[None, :]
    entries = [_entries(aov, tile, picture.samples) for aov, picture in zip((a, b), pictures, strict=True)]
    keys = np.unique(np.concatenate([one[0] for one in entries], axis=0), axis=0)
    if not len(keys):
        return _by_size(grid, np.zeros((len(grid.rows), len(grid.columns))), judging)
    sums = [_sums(keys, *one) for one in entries]
    pixels = grid.sum(np.ones(shape)).ravel()[keys[:, 0]]
    size = np.abs(sums[1][0] - sums[0][0])
    needed = threshold(judging.alpha, len(keys)) * np.sqrt(sums[0][1] + sums[1][1])
    changed = (size > needed) & (size / pixels >= judging.tolerance)
    unsure = (size > 0) & (needed / pixels > judging.tolerance)
    count = len(grid.rows) * len(grid.columns)

    def by_tile(values: npt.NDArray[np.generic]) -> Doubles:
        found = np.zeros(count)
        np.maximum.at(found, keys[:, 0], values.astype(np.float64))
        return found.reshape(len(grid.rows), len(grid.columns))

    return _told(grid, by_tile(changed) > 0, by_tile(unsure) > 0, by_tile(size / pixels))


def _entries(aov: Aov, tile: npt.NDArray[np.intp], samples: float | None) -> tuple[npt.NDArray[np.int64], Doubles, Doubles]:
    """Return tile and id (N, 2) of Cryptomatte entries, their coverage (N) and its variance (N)."""
    pairs = np.ascontiguousarray(aov.values, np.float32).reshape(*tile.shape, -1, 2)
    coverage = pairs[..., 1].astype(np.float64)
    kept = coverage > 0
    ids = np.ascontiguousarray(pairs[..., 0]).view(np.uint32).astype(np.int64)
    of = np.broadcast_to(tile[..., None], kept.shape)
    c = coverage[kept]
    n = math.inf if samples is None else samples
    drawn = c if samples is None else (n * c + 1) / (n + 2)
    return np.stack([of[kept].astype(np.int64), ids[kept]], axis=1), c, drawn * (1 - drawn) / n


def _sums(keys: npt.NDArray[np.int64], at: npt.NDArray[np.int64], *values: Values) -> list[Doubles]:
    """Return sums of values by the rows of `keys` that they belong to."""
    both = np.concatenate([keys, at], axis=0)
    _, place = np.unique(both, axis=0, return_inverse=True)
    place = place.ravel()
    own = np.empty(int(place.max()) + 1, np.int64)
    own[place[: len(keys)]] = np.arange(len(keys))
    where = own[place[len(keys) :]]
    return [np.bincount(where, weights=value, minlength=len(keys)).astype(np.float64) for value in values]
