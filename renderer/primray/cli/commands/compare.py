"""`primray compare`: have two pictures changed, beyond their noise? Exit codes 0 unchanged, 1 changed, 6 undecided, 2 usage."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from ...errors import PrimrayError, SettingsError


class FurtherMetric(Enum):
    FLIP = "flip"


EXIT_CODES = {"unchanged": 0, "changed": 1, "undecided": 6}  # 3 to 5 say something else of renders


def compare(
    a: Annotated[str, typer.Argument(metavar="A", help="EXR with error channels, as `primray render` writes it: before.")],
    b: Annotated[str, typer.Argument(metavar="B", help="EXR of the same size: after.")],
    alpha: Annotated[float, typer.Option(metavar="P", help="False alarms allowed, over all tiles together.")] = 0.001,
    tolerance: Annotated[
        float, typer.Option(metavar="T", help="Smallest relative difference that matters; 0: any that noise does not explain.")
    ] = 0.01,
    tile: Annotated[int, typer.Option(metavar="N", help="Pixels across a tile.")] = 32,
    aovs: Annotated[
        list[str] | None,
        typer.Option(
            "--aov",
            "--aovs",
            metavar="NAME",
            help="Judge these outputs too: names by commas, or all that both have; may be repeated.",
            show_default="the picture alone",
        ),
    ] = None,
    metric: Annotated[
        list[FurtherMetric] | None,
        typer.Option("--metric", help="Beside the verdict, which it does not change (primray[flip]).", show_default=False),
    ] = None,
    allow_bias: Annotated[
        bool, typer.Option("--allow-bias", help="Compare pictures of different --clamp-indirect or --caustics.")
    ] = False,
    difference: Annotated[
        str | None, typer.Option(metavar="FILE", help="PNG or EXR of the difference in units of its noise.", show_default=False)
    ] = None,
    report: Annotated[str | None, typer.Option(metavar="FILE", help="Write the result as JSON.", show_default=False)] = None,
    json: Annotated[bool, typer.Option("--json", help="A JSON line on stdout in place of words.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-V", help="Tracebacks of errors.")] = False,
) -> None:
    """Say whether a picture has changed, tile by tile. Exit code 0: unchanged, 1: changed, 6: needs more samples, 2: usage."""
    try:
        verdict = _compare(a, b, alpha, tolerance, tile, names_of(aovs), difference, report, json, bool(metric), allow_bias)
    except PrimrayError as error:
        error.exit_code = 2  # whatever went wrong: 1 would say that the picture has changed
        raise
    raise typer.Exit(EXIT_CODES[verdict])


def names_of(texts: list[str] | None) -> list[str]:
    return [name for text in texts or () for name in text.split(",") if name]


def _compare(
    a: str,
    b: str,
    alpha: float,
    tolerance: float,
    tile: int,
    aovs: list[str],
    difference: str | None,
    report: str | None,
    json: bool,
    with_flip: bool,
    allow_bias: bool,
) -> str:
    from ...compare.aov_tests import aovs_in, compare_with_aovs
    from ...compare.comparison_report import as_json, lines
    from ...compare.difference_picture import check_difference_path, save_difference
    from ...compare.flip import check_flip, flip
    from ...images.image import write_text
    from ...images.image_file import read_image
    from ...images.output_path import check_folder
    from ..json_lines import dumps, print_line

    if with_flip:
        check_flip()
    if difference is not None:
        check_difference_path(difference)
    if report is not None:
        check_folder(Path(report))
    for output in (difference, report):
        if output is not None and Path(output).resolve() in (Path(a).resolve(), Path(b).resolve()):
            raise SettingsError("the output would replace a picture that is compared", where=output, code="output-folder")
    pictures = read_image(a), read_image(b)
    both = (aovs_in(a), aovs_in(b)) if aovs else ({}, {})
    criteria = {"alpha": alpha, "tolerance": tolerance}
    result = compare_with_aovs(pictures, both, aovs, tile=tile, allow_bias=allow_bias, **criteria)
    seen = flip(*pictures) if with_flip else None
    facts = {"a": a, "b": b, **as_json(result)} | ({} if seen is None else {"flip": seen.as_json()})
    if difference is not None:
        save_difference(result, difference)
    if report is not None:
        write_text(Path(report), dumps(facts, indent=2) + "\n")
    if json:
        print_line({"type": "comparison", **facts})
    else:
        print("\n".join([*lines(result, a, b), *([] if seen is None else [seen.line()])]))
    return result.verdict.value
