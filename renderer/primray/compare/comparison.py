"""Comparison of two images with error channels: a verdict for the whole picture and for every tile.

`changed`: there is a difference of at least `tolerance` (relative) that noise explains with probability below `alpha`, over all
tiles and statistics together. `undecided`: there is no such difference, but a tile is noisy enough to hide one. `unchanged`:
neither. The tests are in difference_tests.py, their inputs in difference.py. If neither picture has error channels,
differences are compared by size only, and nothing is undecided: scene-linear pictures by the RMS of their difference relative
to the RMS of the pictures, display values (PNG, JPEG, TIFF) by the RMS of the difference itself, with white at 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..arrays import Doubles
from ..errors import SettingsError
from ..images.reading import MeasuredImage
from ..settings import BIAS
from .difference import Difference, difference
from .difference_tests import Family, Grid, Resolution, Tests, threshold
from .difference_tests import tiles as tiles_of
from .difference_tests import whole as whole_of
from .flip import Flip, flip, has_flip

DEFAULT_ALPHA = 0.001
DEFAULT_TOLERANCE = 0.01
DEFAULT_TILE = 32
SMALLEST_TILE = 8
_MARGIN = 1.15  # factor on the estimated samples, because the worst of many tiles is a different one next time
_ABOUT_AS_UNLIKELY = 0.7  # factor on log p: a statistic within 16 % of the best
LIKELY = 1.2816  # standard errors beyond the threshold at which a change of the tolerance's size is found 9 times in 10


class Verdict(Enum):
    """Result of a comparison; undecided if noise could hide a difference of the tolerance's size.

    >>> primray.Verdict("changed") is primray.Verdict.CHANGED
    True
    """

    UNCHANGED = "unchanged"
    CHANGED = "changed"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Finding:
    """One significant difference: which statistic found it, where, and how large it is."""

    kind: str
    channel: str
    box: tuple[int, int, int, int]  # x0, y0, x1, y1 in pixels from the upper left, the end not included
    log_p: float  # log probability of such a difference without a change, corrected for all tests of the comparison
    relative: float  # RMS of the difference over that of the picture in the box
    signed: float  # B - A, relative; for moved-x and moved-y pixels to the right and down

    @property
    def p(self) -> float:
        return math.exp(self.log_p)


@dataclass(frozen=True)
class Tile:
    """The result for one tile."""

    box: tuple[int, int, int, int]
    verdict: Verdict
    relative: float  # mean difference over R, G, B, B - A, relative
    resolution: float  # relative mean difference that would be found 9 times in 10
    finding: Finding | None  # the strongest; significant, but below the tolerance unless the tile has changed


@dataclass(frozen=True)
class Needs:
    """Further samples per pixel that would decide every tile; None if no number does, or the image does not state its own."""

    factor: float | None  # factor on the samples of both
    a: int | None  # further samples of A, together with those of B
    b: int | None
    a_alone: int | None  # further samples of A if B gets none
    b_alone: int | None


@dataclass(frozen=True)
class AovTile:
    """The result for one tile of an AOV."""

    box: tuple[int, int, int, int]
    verdict: Verdict
    differs: float  # relative to the values; for ids a share of pixels, for Cryptomattes the largest change of coverage


@dataclass(frozen=True)
class AovComparison:
    """The result for an AOV, compared by `by`: errors, coverage, names, or values if it is exact."""

    name: str
    by: str
    verdict: Verdict
    tiles: tuple[AovTile, ...]
    identical: bool

    def count(self, verdict: Verdict) -> int:
        return sum(tile.verdict is verdict for tile in self.tiles)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Comparison:
    """Result of `primray.compare`. Differences are B - A, relative to the picture; boxes are pixels from the upper left.

    >>> a = primray.render("shot.usda", resolution=(32, 18), spp=8)
    >>> b = primray.render("shot.usda", resolution=(32, 18), spp=8, seed=1)
    >>> comparison = primray.compare(a, b, tolerance=0.5)
    >>> comparison.verdict, len(comparison.tiles), comparison.identical
    (<Verdict.UNCHANGED: 'unchanged'>, 1, False)
    """

    verdict: Verdict
    alpha: float
    tolerance: float
    tiles: tuple[Tile, ...]
    finding: Finding | None  # for the image as a whole
    relative: float  # relative mean difference of the image (for display values, white is 1), with its standard error
    relative_error: float | None  # None: neither picture has errors
    needs: Needs | None  # for an undecided comparison
    unjudged_pixels: int  # pixels without an error estimate, or finite in neither picture
    identical: bool  # bit for bit
    of: Difference
    notes: tuple[str, ...]
    tile: int = DEFAULT_TILE  # pixels across
    aovs: tuple[AovComparison, ...] = ()  # the requested AOVs, which the verdict includes
    by: str = "errors"  # standard errors, or else scene-linear "values" or "display" values
    flip: Flip | None = None  # for display values, if the package is installed

    def __repr__(self) -> str:
        tiles = ", ".join(f"{self.count(verdict)} {verdict.value}" for verdict in Verdict if self.count(verdict))
        mean = f"{100 * self.relative:+.3g} %"
        mean += "" if self.relative_error is None else f" +- {100 * self.relative_error:.2g} %"
        return f"<Comparison {self.verdict.value}; tiles: {tiles}; mean difference {mean}>"

    def __bool__(self) -> bool:
        """Raise TypeError, because it would be unclear whether true means "changed" or "the same"."""
        raise TypeError("a Comparison has no truth value; use its verdict")

    def count(self, verdict: Verdict) -> int:
        return sum(tile.verdict is verdict for tile in self.tiles)


def compare(
    a: MeasuredImage,
    b: MeasuredImage,
    *,
    alpha: float = DEFAULT_ALPHA,
    tolerance: float = DEFAULT_TOLERANCE,
    tile: int = DEFAULT_TILE,
    allow_bias: bool = False,
) -> Comparison:
    """Compare by standard errors, or by values if neither picture has any; SettingsError if the two cannot be compared.

    `allow_bias`: compare even if different light was left out by `clamp_indirect` or `caustics`.
    """
    check_criteria(alpha, tolerance, tile)
    if not allow_bias:
        _require_same_bias(a, b)
    of = difference(a, b)
    if a.stderr is None and b.stderr is None:
        seen = flip(a, b) if a.is_display and has_flip() else None
        return _compared_by_values(of, alpha, tolerance, tile, a.is_display, seen)
    tests = Tests(of, tile)
    families, resolution = tests.run()
    findings = _findings(families, alpha, of.channels)
    reach, factor = _reach(resolution, families, alpha, of)
    tiles = _tiles(of, tests, findings, reach, tolerance)
    image = _strongest([f for f in findings if f.box == tests.image.box(0, 0) and f.kind != "spot"], tolerance)
    relative, relative_error = _mean_difference(of, tests)

    verdict = Verdict.UNCHANGED
    if any(t.verdict is Verdict.UNDECIDED for t in tiles):
        verdict = Verdict.UNDECIDED
    if any(t.verdict is Verdict.CHANGED for t in tiles) or (image is not None and _matters(image, tolerance)):
        verdict = Verdict.CHANGED
    return Comparison(
        verdict=verdict,
        alpha=alpha,
        tolerance=tolerance,
        tiles=tuple(tiles),
        finding=image,
        relative=relative,
        relative_error=relative_error,
        needs=_needs(reach, factor, resolution, tolerance, of) if verdict is Verdict.UNDECIDED else None,
        unjudged_pixels=int(of.judged.size - np.count_nonzero(of.judged | of.broken)),
        identical=not of.d.any() and bool(of.judged.all()),
        of=of,
        notes=of.notes,
        tile=tile,
    )


def _compared_by_values(
    of: Difference, alpha: float, tolerance: float, tile: int, display: bool, seen: Flip | None
) -> Comparison:
    """Return regions as changed if they differ by the tolerance. A change that is spread thinly may show only in the whole."""
    shape = of.judged.shape
    finest, image = tiles_of(shape, tile), whole_of(shape)
    tiles = tuple(_tiles_by_values(of, finest, tolerance, display))
    (everything,) = _tiles_by_values(of, image, tolerance, display)
    changed = any(one.verdict is Verdict.CHANGED for one in (*tiles, everything))
    identical = not of.d.any() and bool(of.judged.all())
    notes = of.notes if identical else (*of.notes, DISPLAY_NOTE if display else LINEAR_NOTE)
    return Comparison(
        verdict=Verdict.CHANGED if changed else Verdict.UNCHANGED,
        alpha=alpha,
        tolerance=tolerance,
        tiles=tiles,
        finding=everything.finding,
        relative=everything.relative,
        relative_error=None,
        needs=None,
        unjudged_pixels=int(of.judged.size - np.count_nonzero(of.judged | of.broken)),
        identical=identical,
        of=of,
        notes=notes,
        tile=tile,
        by="display" if display else "values",
        flip=seen,
    )


def _tiles_by_values(of: Difference, grid: Grid, tolerance: float, display: bool) -> list[Tile]:
    found = apart(of, grid, display)
    broken = grid.sum(of.broken.astype(np.float64)) > 0
    tiles = []
    for y, x in np.ndindex(*found.size.shape):
        size, signed, box = float(found.size[y, x]), float(found.signed[y, x]), grid.box(y, x)
        finding = (
            Finding(kind="values", channel="RGB", box=box, log_p=-math.inf, relative=size, signed=signed) if size > 0 else None
        )
        if broken[y, x]:
            finding = Finding(kind="not-finite", channel="RGB", box=box, log_p=-math.inf, relative=math.inf, signed=math.inf)
        changed = finding is not None and _matters(finding, tolerance)
        tiles.append(Tile(box, Verdict.CHANGED if changed else Verdict.UNCHANGED, signed, 0.0, finding))
    return tiles


def check_criteria(alpha: float, tolerance: float, tile: int) -> None:
    """Raise SettingsError for invalid criteria."""
    if not 0 < alpha < 1:
        raise SettingsError(f"the false-alarm rate must be between 0 and 1, not {alpha}", code="alpha")
    if not (math.isfinite(tolerance) and tolerance >= 0):
        raise SettingsError(f"the tolerance must be a relative difference of at least 0, not {tolerance}", code="tolerance")
    if tile < SMALLEST_TILE:
        raise SettingsError(f"tiles must be at least {SMALLEST_TILE} pixels across, not {tile}", code="tile")


def _require_same_bias(a: MeasuredImage, b: MeasuredImage) -> None:
    """Raise SettingsError if the pictures differ in `clamp_indirect` or `caustics`.

    A header that does not mention a bias has none.
    """
    for name, none in BIAS.items():
        values = [_bias_of(picture, name, none) for picture in (a, b)]
        if values[0] != values[1]:
            has, other = (f"{text} in {picture.name or side}" for text, picture, side in zip(values, (a, b), "AB", strict=True))
            sentence = f"the pictures leave out different light: {name.replace('_', ' ')} is {has} and {other}"
            raise SettingsError(f"{sentence}; --allow-bias compares them anyway", code="different-bias")


def _bias_of(picture: MeasuredImage, name: str, none: object) -> str:
    value = picture.metadata.get(f"settings.{name}", none)
    if isinstance(none, bool):
        return "on" if bool(value) else "off"
    return "off" if value is None else f"{float(str(value)):g}"


def _tests_for_one(family: Family, families: list[Family]) -> int:
    """Return the number of tests that share alpha with one of this family.

    Families have equal parts of alpha, whatever their size.
    """
    return family.log_p.size * len(families)


def _findings(families: list[Family], alpha: float, channels: tuple[str, ...]) -> list[Finding]:
    found = []
    for family in families:
        log_p = family.log_p + math.log(_tests_for_one(family, families))
        for c, y, x in np.argwhere(log_p <= math.log(alpha)):
            found.append(
                Finding(
                    kind=family.kind,
                    channel=channels[c],
                    box=family.grid.box(y, x),
                    log_p=float(log_p[c, y, x]),
                    relative=float(family.size[c, y, x]),
                    signed=float(family.signed[c, y, x]),
                )
            )
    return found


def _matters(finding: Finding, tolerance: float) -> bool:
    return finding.relative >= tolerance


def _strongest(findings: list[Finding], tolerance: float) -> Finding | None:
    """Return the largest of the findings that are about as unlikely as the least likely one, preferring those that matter."""
    chosen = [f for f in findings if _matters(f, tolerance)] or findings
    if not chosen:
        return None
    least = _ABOUT_AS_UNLIKELY * min(f.log_p for f in chosen)
    return max((f for f in chosen if f.log_p <= least), key=lambda f: (f.kind != "spot", f.relative))


def _reach(resolution: Resolution, families: list[Family], alpha: float, of: Difference) -> tuple[Doubles, Doubles]:
    """Return the relative mean difference (C, h, w) of a tile that is found 9 times in 10, and the factor of noise in it.

    A difference D adds D^2 / 3 per pixel to V, so small tiles never reach the threshold; the result is infinite there.
    """
    family = next(f for f in families if f.kind == "shift" and f.grid is resolution.grid)
    needed = threshold(alpha, _tests_for_one(family, families)) + LIKELY
    room = 1 - needed**2 / (3 * np.maximum(resolution.pixels, 1))
    factor = np.where(room > 0, needed / np.sqrt(np.maximum(room, 1e-9)), np.inf)
    factor = np.broadcast_to(factor, resolution.noise.shape)
    same = resolution.grid.sum((of.d != 0).any(axis=0).astype(np.float64)) == 0
    all_known = resolution.grid.sum((~of.judged).astype(np.float64)) == 0
    # Identical tiles hide nothing, because independent noise would differ.
    quiet = np.broadcast_to(same & all_known, resolution.noise.shape)
    with np.errstate(invalid="ignore"):
        reach = np.where(resolution.noise > 0, resolution.noise * factor, np.where(np.isfinite(factor), 0.0, np.inf))
    return np.where(quiet, 0.0, reach), factor


def _tiles(of: Difference, tests: Tests, findings: list[Finding], reach: Doubles, tolerance: float) -> list[Tile]:
    grid = tests.tiles
    by_tile: dict[tuple[int, int], list[Finding]] = {}
    image_box = tests.image.box(0, 0)
    for finding in findings:
        x0, y0, x1, y1 = finding.box
        if finding.box == image_box and (len(grid.rows), len(grid.columns)) != (1, 1):
            continue
        y = int(np.searchsorted(grid.rows, (y0 + y1) // 2, side="right")) - 1
        x = int(np.searchsorted(grid.columns, (x0 + x1) // 2, side="right")) - 1
        by_tile.setdefault((y, x), []).append(finding)
    for y, x in np.argwhere(grid.sum(of.broken.astype(np.float64)) > 0):
        broken = Finding(
            kind="not-finite", channel="RGB", box=grid.box(y, x), log_p=-math.inf, relative=math.inf, signed=math.inf
        )
        by_tile.setdefault((int(y), int(x)), []).append(broken)
    mean = tile_means(of, tests)
    tiles = []
    for y in range(len(grid.rows)):
        for x in range(len(grid.columns)):
            finding_here = _strongest(by_tile.get((y, x), []), tolerance)
            worst = float(reach[:, y, x].max())
            verdict = Verdict.UNCHANGED
            if finding_here is not None and _matters(finding_here, tolerance):
                verdict = Verdict.CHANGED
            elif worst > tolerance > 0 or not np.isfinite(worst):
                verdict = Verdict.UNDECIDED
            tiles.append(Tile(grid.box(y, x), verdict, float(mean[y, x]), worst, finding_here))
    return tiles


def tile_means(of: Difference, tests: Tests) -> Doubles:
    count = tests.tiles.sum(of.judged.astype(np.float64))
    return tests.relative(tests.tiles.sum(of.d[:3].mean(axis=0)) / np.maximum(count, 1), tests.tiles, 0)


def _mean_difference(of: Difference, tests: Tests) -> tuple[float, float]:
    """Return the mean difference of the image over R, G, B and its error.

    Channels are assumed fully correlated, the worst case.
    """
    count = max(int(np.count_nonzero(of.judged)), 1)
    mean = of.d[:3].mean() * of.judged.size / count
    deviation = np.sqrt((of.d[:3] ** 2 + 2 * (of.variance_a + of.variance_b)[:3]).sum(axis=(1, 2)) / 3).mean() / count
    pair = tests.relative(np.array([[mean, deviation]]), tests.image, 0)
    return float(pair[0, 0]), float(pair[0, 1])


def _needs(reach: Doubles, factor: Doubles, resolution: Resolution, tolerance: float, of: Difference) -> Needs:
    """Return the samples that decide the comparison, for variance proportional to 1 / samples.

    Quasi-random points may need fewer, rare bright paths more.
    """
    na, nb = of.samples
    if not np.isfinite(reach).all() or tolerance == 0:
        return Needs(None, None, None, None, None)
    square, share = _MARGIN * (reach / tolerance) ** 2, resolution.share_a
    more = float(np.max(square))

    def alone(share_of_it: Doubles, has: float | None) -> int | None:
        # share / k + (1 - share) = 1 / square, for every tile that is not good enough yet
        open_tiles = square > 1
        rest = 1 / square[open_tiles] - (1 - share_of_it[open_tiles])
        if has is None or (rest <= 0).any():
            return None
        return _further(has, float((share_of_it[open_tiles] / rest).max()))

    return Needs(
        more,
        _further(na, more) if na else None,
        _further(nb, more) if nb else None,
        alone(share, na),
        alone(1 - share, nb),
    )


def _further(has: float, factor: float) -> int:
    return math.ceil(has * (factor - 1))


LINEAR_NOTE = "neither picture has standard errors: differences are judged by size alone, including noise"
DISPLAY_NOTE = "both have display values without standard errors: differences are judged by size alone, including noise"


@dataclass(frozen=True, eq=False)
class Apart:
    """Differences of regions of two pictures, (h, w) each."""

    size: Doubles  # root mean square of the difference over all channels
    signed: Doubles  # mean difference over R, G, B: B - A


def apart(of: Difference, grid: Grid, display: bool) -> Apart:
    """Compute the differences of a grid's regions, relative to the picture unless the values are display values."""
    pixels = np.maximum(grid.sum(of.judged.astype(np.float64)), 1.0)
    square = grid.sum((of.d**2).mean(axis=0)) / pixels
    signed = grid.sum(of.d[:3].mean(axis=0)) / pixels
    if display:
        return Apart(np.sqrt(square), signed)
    power = grid.sum((of.mean**2).mean(axis=0)) / pixels + of.floor**2
    scale = np.sqrt(np.where(power > 0, power, 1.0))
    return Apart(np.sqrt(square) / scale, signed / scale)
