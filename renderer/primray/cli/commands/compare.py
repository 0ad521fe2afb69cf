"""`primray compare`: have two pictures, sequences or folders changed, beyond their noise?

Exit codes: 0 unchanged, 1 changed, 6 undecided, 2 usage error, or a pair of a sequence or folder that cannot be compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import PrimrayError, SettingsError

if TYPE_CHECKING:
    from ...compare.comparison import Comparison
    from ...compare.sequences import Pair, PairComparison, Pairing, SequenceComparison


class FurtherMetric(Enum):
    FLIP = "flip"


EXIT_CODES = {"unchanged": 0, "changed": 1, "undecided": 6}  # 3 to 5 have other meanings for renders


def compare(
    a: Annotated[
        str,
        typer.Argument(
            metavar="A",
            help="Picture before: an EXR with errors, any picture, or a .npy array; a sequence (shot.####.exr) or folder.",
        ),
    ],
    b: Annotated[str, typer.Argument(metavar="B", help="Picture after, of the same kind and size.")],
    alpha: Annotated[float, typer.Option(metavar="P", help="False-alarm rate over all tiles together.")] = 0.001,
    tolerance: Annotated[
        float, typer.Option(metavar="T", help="Smallest relative difference that matters; 0: any difference beyond noise.")
    ] = 0.01,
    tile: Annotated[int, typer.Option(metavar="N", help="Tile size in pixels.")] = 32,
    aovs: Annotated[
        list[str] | None,
        typer.Option(
            "--aov",
            "--aovs",
            metavar="NAME",
            help="Also compare these AOVs: names separated by commas, or all that both have; may be repeated.",
            show_default="the picture alone",
        ),
    ] = None,
    metric: Annotated[
        list[FurtherMetric] | None,
        typer.Option(
            "--metric",
            help="Also print this metric, which does not affect the verdict (needs primray[flip]).",
            show_default=False,
        ),
    ] = None,
    allow_bias: Annotated[
        bool, typer.Option("--allow-bias", help="Compare pictures with different --clamp-indirect or --caustics.")
    ] = False,
    difference: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Write the difference in units of noise as PNG or EXR; for sequences a name with ####, for folders a folder.",
            show_default=False,
        ),
    ] = None,
    report: Annotated[str | None, typer.Option(metavar="FILE", help="Write the result as JSON.", show_default=False)] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON lines to stdout instead of text.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-V", help="Print tracebacks of errors.")] = False,
) -> None:
    """Report whether a picture has changed. Exit code 0: unchanged, 1: changed, 6: more samples needed, 2: usage error."""
    from ...compare.sequences import pairing

    asked = Asked(
        a=a,
        b=b,
        alpha=alpha,
        tolerance=tolerance,
        tile=tile,
        aovs=names_of(aovs),
        difference=difference,
        report=report,
        json=json,
        with_flip=bool(metric),
        allow_bias=allow_bias,
    )
    try:
        found = pairing(a, b)
        code = EXIT_CODES[_compare_pictures(asked)] if found is None else _compare_pairs(asked, found)
    except PrimrayError as error:
        error.exit_code = 2  # for any error, because 1 means that the picture has changed
        raise
    raise typer.Exit(code)


@dataclass(frozen=True)
class Asked:
    """The arguments of the command."""

    a: str
    b: str
    alpha: float
    tolerance: float
    tile: int
    aovs: list[str]
    difference: str | None
    report: str | None
    json: bool
    with_flip: bool
    allow_bias: bool

    @property
    def criteria(self) -> dict[str, Any]:
        return {"alpha": self.alpha, "tolerance": self.tolerance, "tile": self.tile, "allow_bias": self.allow_bias}


def names_of(texts: list[str] | None) -> list[str]:
    return [name for text in texts or () for name in text.split(",") if name]


def _compare_pictures(asked: Asked) -> str:
    from ...compare.aov_tests import compare_with_aovs
    from ...compare.comparable import aovs_of, read_picture
    from ...compare.comparison_report import as_json, check_difference_path, lines, save_difference
    from ...compare.flip import check_flip, flip
    from ..console import print_line

    if asked.with_flip:
        check_flip()
    if asked.difference is not None:
        check_difference_path(asked.difference)
    _check_outputs(asked, [Path(asked.a), Path(asked.b)])
    pictures = read_picture(asked.a), read_picture(asked.b)
    both = (aovs_of(asked.a), aovs_of(asked.b)) if asked.aovs else ({}, {})
    result = compare_with_aovs(pictures, both, asked.aovs, **asked.criteria)
    seen = flip(*pictures) if asked.with_flip and result.flip is None else None
    facts = {"a": asked.a, "b": asked.b, **as_json(result)} | ({} if seen is None else {"flip": seen.as_json()})
    if asked.difference is not None:
        save_difference(result, asked.difference)
    _write_report(asked, facts)
    if asked.json:
        print_line({"type": "comparison", **facts})
    else:
        print("\n".join([*lines(result, asked.a, asked.b), *([] if seen is None else [seen.line()])]))
    return result.verdict.value


def _check_outputs(asked: Asked, pictures: list[Path]) -> None:
    from ...images.output_path import check_folder

    if asked.report is not None:
        check_folder(Path(asked.report))
    inputs = {path.resolve() for path in pictures}
    for output in (asked.difference, asked.report):
        if output is not None and Path(output).resolve() in inputs:
            raise SettingsError("the output would overwrite a picture being compared", where=output, code="output-folder")


def _write_report(asked: Asked, facts: dict[str, Any]) -> None:
    from ...images.image import write_text
    from ..console import dumps

    if asked.report is not None:
        write_text(Path(asked.report), dumps(facts, indent=2) + "\n")


def _compare_pairs(asked: Asked, found: Pairing) -> int:
    from ...compare.comparable import read_picture
    from ...compare.comparison_report import save_difference
    from ...compare.flip import check_flip, flip
    from ...compare.sequences import compare_pairs
    from ..console import print_line

    if asked.with_flip:
        check_flip()
    difference = _difference_names(asked, found)
    _check_outputs(asked, [path for pair in found.pairs for path in (pair.a, pair.b)])
    rows: list[dict[str, Any]] = []

    def show(pair: Pair, result: PairComparison, comparison: Comparison | None) -> None:
        facts = {found.kind: pair.name, "a": result.a, "b": result.b, **result.facts}
        line = result.line
        if comparison is not None and asked.with_flip and comparison.flip is None:
            seen = flip(read_picture(pair.a), read_picture(pair.b))
            facts["flip"], line = seen.as_json(), f"{line}; FLIP {seen.mean:.4f}"
        if comparison is not None and difference is not None:
            save_difference(comparison, difference(pair))
        rows.append(facts)
        if asked.json:
            print_line({"type": "comparison", **facts})
        else:
            verdict = "cannot be compared" if result.error is not None else result.verdict.value
            print(f"{found.kind} {pair.name}: {verdict}: {line}", flush=True)

    whole = compare_pairs(found, aovs=asked.aovs, **asked.criteria, each=show)
    facts = _facts_of(whole, asked)
    _write_report(asked, {**facts, "pairs": rows})
    if asked.json:
        print_line({"type": "comparisons", **facts})
    else:
        print("\n".join(_summary(whole, asked)))
    return 2 if whole.failed else EXIT_CODES[whole.verdict.value]


def _difference_names(asked: Asked, found: Pairing) -> Callable[[Pair], Path] | None:
    """Return the path of each pair's difference: the name with its frame number filled in, or the pair's name in a folder."""
    from ...compare.comparison_report import check_difference_path
    from ...images.output_path import make_folder
    from ...render.frames import frame_name

    if asked.difference is None:
        return None
    name, text = frame_name(asked.difference), asked.difference
    if found.kind == "frame":
        if not name.has_holder:
            sentence = "difference pictures of a sequence need a frame number placeholder in their name, such as ####"
            raise SettingsError(sentence, where=text, code="frames")
        check_difference_path(name.of(float(found.pairs[0].name)))
        return lambda pair: Path(name.of(float(pair.name)))
    if Path(text).suffix and not Path(text).is_dir():
        raise SettingsError("difference pictures of folders need a folder as output", where=text, code="output-folder")

    def below(pair: Pair) -> Path:
        path = Path(text) / f"{pair.name}.png"
        make_folder(path)
        return path

    return below


def _facts_of(whole: SequenceComparison, asked: Asked) -> dict[str, Any]:
    from ...compare.comparison import Verdict

    worst = whole.worst
    return {
        "a": asked.a,
        "b": asked.b,
        "verdict": whole.verdict.value,
        "alpha": asked.alpha,
        "tolerance": asked.tolerance,
        "count": {verdict.value: whole.count(verdict) for verdict in Verdict} | {"failed": len(whole.failed)},
        "only_a": list(whole.only_a),
        "only_b": list(whole.only_b),
        "worst": None if worst is None else {whole.kind: worst.name, "a": worst.a, "b": worst.b},
    }


def _summary(whole: SequenceComparison, asked: Asked) -> Iterator[str]:
    from ...compare.comparison import Verdict

    counted = [f"{whole.count(verdict)} {verdict.value}" for verdict in Verdict if whole.count(verdict)]
    counted += [f"{len(whole.failed)} cannot be compared"] if whole.failed else []
    many = "pair" if len(whole.pairs) == 1 else "pairs"
    yield f"{whole.verdict.value}: {asked.a} (A) and {asked.b} (B), {len(whole.pairs)} {many}: {', '.join(counted)}"
    plural = f"{whole.kind}s"
    for which, names in (("A", whole.only_a), ("B", whole.only_b)):
        if names:
            yield f"  {len(names)} {whole.kind if len(names) == 1 else plural} only in {which}: {_listed(names)}"
    if whole.worst is not None and any(not pair.facts.get("identical") for pair in whole.pairs):
        yield f"  worst: {whole.kind} {whole.worst.name}: {whole.worst.line}"
    for note in whole.notes:
        yield f"  note: {note}"


def _listed(names: tuple[str, ...], most: int = 12) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
