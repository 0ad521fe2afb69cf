"""Comparison of two sequences or folders of pictures, pair by pair: frames by number, files by name.

All pairs share the false-alarm rate. A picture that exists on one side only is a change, and is listed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import PrimrayError, SettingsError
from ..render.frames import FrameName, frame_name, numbered_files
from .aov_tests import compare_with_aovs
from .comparable import SUFFIX, aovs_of, read_picture
from .comparison import Comparison, Tile, Verdict, check_criteria, compare
from .comparison_report import as_json, tile_line, worst_tiles

PICTURES = (".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".hdr", SUFFIX)
_ORDER = (Verdict.CHANGED, Verdict.UNDECIDED, Verdict.UNCHANGED)


@dataclass(frozen=True)
class Pair:
    """Two files to compare. `name` is the frame number, or the file's path below both folders."""

    name: str
    a: Path
    b: Path


@dataclass(frozen=True)
class Pairing:
    """The pairs of two sequences or folders, and the names that exist on one side only."""

    pairs: tuple[Pair, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    kind: str  # "frame" or "file": what names refer to


@dataclass(frozen=True, kw_only=True)
class PairComparison:
    """The result of one pair. It has no pixels, because a sequence may have thousands of frames."""

    name: str
    a: str
    b: str
    verdict: Verdict
    error: PrimrayError | None  # why the two cannot be compared; the verdict is then undecided
    size: float  # relative difference of the worst changed tile, else the largest difference
    line: str  # location and size of the difference as text
    facts: Mapping[str, Any]  # as `primray compare --json` prints them, without tiles


@dataclass(frozen=True, repr=False)
class SequenceComparison:
    """Result of `primray.compare` for two sequences or folders: changed if a pair is, or if one side lacks a picture.

    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=8)
    >>> names = [image.save(name).name for name in ("a.0001.exr", "a.0002.exr", "b.01.exr")]
    >>> comparison = primray.compare("a.####.exr", "b.%02d.exr")
    >>> comparison.verdict, [pair.name for pair in comparison.pairs], comparison.only_a
    (<Verdict.CHANGED: 'changed'>, ['1'], ('2',))
    """

    pairs: tuple[PairComparison, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    kind: str

    @property
    def verdict(self) -> Verdict:
        found = {pair.verdict for pair in self.pairs} | ({Verdict.CHANGED} if self.only_a or self.only_b else set())
        return next(verdict for verdict in _ORDER if verdict in found)

    @property
    def identical(self) -> bool:
        """Whether both sides have the same pictures, bit for bit."""
        return not (self.only_a or self.only_b) and all(pair.facts.get("identical") for pair in self.pairs)

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions of the comparisons, each once."""
        return tuple(dict.fromkeys(note for pair in self.pairs for note in pair.facts.get("notes", ())))

    @property
    def failed(self) -> tuple[PairComparison, ...]:
        return tuple(pair for pair in self.pairs if pair.error is not None)

    @property
    def worst(self) -> PairComparison | None:
        """The pair of the worst verdict that differs most; None if no pair could be compared."""
        compared = [pair for pair in self.pairs if pair.error is None]
        return min(compared, key=lambda pair: (_ORDER.index(pair.verdict), -pair.size), default=None)

    def count(self, verdict: Verdict) -> int:
        return sum(pair.verdict is verdict and pair.error is None for pair in self.pairs)

    def __repr__(self) -> str:
        counts = ", ".join(f"{self.count(verdict)} {verdict.value}" for verdict in _ORDER if self.count(verdict))
        return f"<SequenceComparison {self.verdict.value}; pairs: {counts or 'none'}>"

    def __bool__(self) -> bool:
        """Raise TypeError, because it would be unclear whether true means "changed" or "the same"."""
        raise TypeError("a SequenceComparison has no truth value; use its verdict")


def pairing(a: str, b: str) -> Pairing | None:
    """Pair two sequences by frame number or two folders by file name; None if both are single pictures."""
    kinds = _kind(a), _kind(b)
    if kinds == ("picture", "picture"):
        return None
    for path, kind in zip((a, b), kinds, strict=True):
        if kind == "picture" and not Path(path).exists():
            raise SettingsError("no such file or folder", where=path, code="image-missing")
    if kinds[0] != kinds[1]:
        sentence = (
            f"A is a {kinds[0]} and B a {kinds[1]}: compare a folder with a folder, or a sequence (a name with a frame "
            "placeholder, such as shot.####.exr) with a sequence"
        )
        raise SettingsError(sentence, where=b, code="compare-pairs")
    files = _folder_files if kinds[0] == "folder" else _sequence_files
    both = files(a), files(b)
    names = [name for name in both[0] if name in both[1]]
    only_a, only_b = (tuple(name for name in own if name not in other) for own, other in (both, both[::-1]))
    if not names:
        shown = [f"{which} has {', '.join(list(has)[:3]) or 'none'}" for which, has in zip("AB", both, strict=True)]
        what = "file name" if kinds[0] == "folder" else "frame"
        sentence = f"no {what} exists on both sides: {'; '.join(shown)}"
        raise SettingsError(sentence, where=b, code="compare-pairs")
    pairs = tuple(Pair(name, both[0][name], both[1][name]) for name in names)
    return Pairing(pairs, only_a, only_b, "file" if kinds[0] == "folder" else "frame")


def _kind(path: str) -> str:
    if Path(path).is_dir():
        return "folder"
    return "sequence" if frame_name(path).has_holder and not Path(path).exists() else "picture"


def _sequence_files(text: str) -> dict[str, Path]:
    name: FrameName = frame_name(text)
    found = {f"{number:g}": path for number, path in numbered_files(name).items()}
    if not found:
        raise SettingsError("the sequence has no frames: no file matches the name", where=text, code="image-missing")
    return found


def _folder_files(text: str) -> dict[str, Path]:
    """Return pictures below a folder by their relative paths, without hidden ones."""
    folder = Path(text)
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in PICTURES and path.is_file())
    names = {path.relative_to(folder): path for path in paths}
    return {name.as_posix(): path for name, path in names.items() if not any(part.startswith(".") for part in name.parts)}


def compare_pairs(
    found: Pairing,
    *,
    alpha: float,
    tolerance: float,
    tile: int,
    aovs: Iterable[str] = (),
    allow_bias: bool = False,
    each: Callable[[Pair, PairComparison, Comparison | None], None] | None = None,
) -> SequenceComparison:
    """Compare all pairs. `each` is called with every pair's result as it is found, while its pixels are in memory."""
    check_criteria(alpha, tolerance, tile)
    share, asked, results = alpha / len(found.pairs), list(aovs), []
    for pair in found.pairs:
        comparison: Comparison | None = None
        try:
            comparison = _compared(pair, asked, alpha=share, tolerance=tolerance, tile=tile, allow_bias=allow_bias)
            result = _result(pair, comparison)
        except PrimrayError as error:
            failed: dict[str, Any] = {"verdict": None, "error": {"code": error.code, "message": error.message}}
            result = PairComparison(
                name=pair.name,
                a=str(pair.a),
                b=str(pair.b),
                verdict=Verdict.UNDECIDED,
                error=error,
                size=0.0,
                line=str(error),
                facts=failed,
            )
        if each is not None:
            each(pair, result, comparison)
        results.append(result)
    return SequenceComparison(tuple(results), found.only_a, found.only_b, found.kind)


def _compared(pair: Pair, aovs: list[str], **criteria: Any) -> Comparison:
    pictures = read_picture(pair.a), read_picture(pair.b)
    if not aovs:
        return compare(*pictures, **criteria)
    return compare_with_aovs(pictures, (aovs_of(pair.a), aovs_of(pair.b)), aovs, **criteria)


def _result(pair: Pair, comparison: Comparison) -> PairComparison:
    facts = as_json(comparison)
    facts["aovs"] = {name: {key: each[key] for key in each if key != "tiles"} for name, each in facts["aovs"].items()}
    facts["worst_tile"] = _worst_tile(facts.pop("tiles"), comparison)
    worst = worst_tiles(comparison)[0]
    return PairComparison(
        name=pair.name,
        a=str(pair.a),
        b=str(pair.b),
        verdict=comparison.verdict,
        error=None,
        size=_size(comparison, worst),
        line=_line(comparison, worst),
        facts=facts,
    )


def _worst_tile(tiles: list[dict[str, Any]], comparison: Comparison) -> dict[str, Any]:
    box = list(worst_tiles(comparison)[0].box)
    return next(tile for tile in tiles if tile["box"] == box)


def _size(comparison: Comparison, worst: Tile) -> float:
    own = [abs(comparison.relative), *(finding.relative for finding in (comparison.finding, worst.finding) if finding)]
    return max(own + [tile.differs for aov in comparison.aovs for tile in aov.tiles if tile.verdict is Verdict.CHANGED])


def _line(comparison: Comparison, worst: Tile) -> str:
    if comparison.identical:
        return "identical"
    changed = [aov.name for aov in comparison.aovs if aov.verdict is Verdict.CHANGED]
    words = [f"AOV {', '.join(changed)}"] if changed else []
    if worst.verdict is not Verdict.UNCHANGED or worst.finding is not None:
        words.append(tile_line(worst, comparison.tolerance, comparison.by))
    if comparison.flip is not None:
        words.append(f"FLIP {comparison.flip.mean:.4f}")
    return "; ".join(words) or "no difference beyond noise"
