"""`primray dataset`: many pictures of one stage in which things vary, with labels; and their verification."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from ..flags import in_order

if TYPE_CHECKING:
    from ...dataset import Made, Verification

VERIFY = "verify"
EVERY_S = 2.0  # between lines of progress


@in_order()
def dataset(
    source: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG|verify", help="The YAML of what varies; or the word verify, and a folder.", show_default=False
        ),
    ],
    folder: Annotated[str | None, typer.Argument(metavar="[DIR]", help="The data set to verify.", show_default=False)] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder of the data set; what is there goes on.", show_default=False
        ),
    ] = None,
    processes: Annotated[
        int | None,
        typer.Option("--processes", "-n", metavar="N", help="Number of simultaneous renders.", show_default="1"),
    ] = None,
    ray: Annotated[
        str | None,
        typer.Option(
            "--ray",
            metavar="ADDRESS",
            help="Render on the nodes of the Ray cluster with this head, HOST:PORT or auto, which see the same folders; "
            "-n workers, as many as it has cores by default.",
            show_default=False,
        ),
    ] = None,
    threads: int | None = None,
    share: Annotated[
        float, typer.Option("--share", metavar="SHARE", help="Share of the samples that verify renders again.")
    ] = 0.01,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="N", help="Seed of which samples verify chooses.", show_default="another each time"),
    ] = None,
    inputs: Annotated[
        str | None,
        typer.Option("--inputs", metavar="DIR", help="Folder of the config's files, for verify.", show_default="where it was"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")] = False,
) -> None:
    """Make a data set from a YAML of what varies, or verify one by rendering a random share of it again.

    A data set goes on where it was ended. verify exits with 1 where inputs, settings or pixels are not as they were.
    """
    if source == VERIFY:
        if folder is None or output is not None:
            raise SettingsError("verify takes the folder of a data set: primray dataset verify DIR", code="dataset-verify")
        _verify(folder, share, seed, inputs, threads, as_json)
        return
    if folder is not None or output is None:
        raise SettingsError("-o names the folder of the data set: primray dataset CONFIG -o DIR", code="dataset-output")
    _make(source, output, processes, ray, threads, as_json)


def _make(source: str, output: str, processes: int | None, ray: str | None, threads: int | None, as_json: bool) -> None:
    from ...dataset import Config, LocalWorkers, RayWorkers, make

    config = Config.read(source)
    executor: LocalWorkers | RayWorkers = LocalWorkers(1 if processes is None else processes)
    if ray is not None:
        executor = RayWorkers(ray, workers=processes, cores=threads or 1)
    made = make(config, output, threads=threads, executor=executor, progress=_shown("samples done"))
    _print_made(made, as_json)


def _print_made(made: Made, as_json: bool) -> None:
    for note in made.notes:
        print(note, file=sys.stderr)
    for code, count in made.diagnostics.items():
        print(f"{code}: in {count} of {made.rendered} samples (their sample.json says where)", file=sys.stderr)
    if as_json:
        _print_json(
            {
                "type": "dataset",
                "folder": str(made.folder),
                "samples": made.samples,
                "rendered": made.rendered,
                "diagnostics": dict(made.diagnostics),
                "notes": list(made.notes),
            }
        )
    else:
        print(f"{made.folder}: {made.samples} samples, {made.rendered} of them rendered now")


def _verify(folder: str, share: float, seed: int | None, inputs: str | None, threads: int | None, as_json: bool) -> None:
    from ...dataset import verify

    if not Path(folder).is_dir():
        raise SettingsError("there is no such folder", where=folder, code="dataset-incomplete")
    found = verify(folder, share=share, seed=seed, inputs=inputs, threads=threads, progress=_shown("samples rendered again"))
    _print_verification(folder, found, as_json)
    if found.difference is not None:
        raise typer.Exit(1)


def _print_verification(folder: str, found: Verification, as_json: bool) -> None:
    difference = found.difference
    if as_json:
        told = None
        if difference is not None:
            told = {
                "kind": difference.kind,
                "what": difference.what,
                "before": difference.before,
                "now": difference.now,
            }
        _print_json(
            {
                "type": "dataset-verification",
                "same": difference is None,
                "difference": told,
                "samples": list(found.samples),
                "notes": list(found.notes),
            }
        )
        return
    for note in found.notes:
        print(f"the same pixels, though {note}", file=sys.stderr)
    count = len(found.samples)
    if difference is None:
        print(f"{folder}: the same bits in {count} sample{'' if count == 1 else 's'} rendered again")
    else:
        print(f"{folder}: differs: {difference}")


def _print_json(value: dict[str, Any]) -> None:
    from ..console import dumps

    print(dumps(value))


def _shown(what: str) -> Callable[[int, int], None]:
    """Return a progress that prints a line from time to time, with how many a second there are."""
    begun = last = time.monotonic()
    first: int | None = None

    def show(done: int, count: int) -> None:
        nonlocal last, first
        now = time.monotonic()
        first = done - 1 if first is None else first
        if now - last >= EVERY_S or done == count:
            last = now
            print(f"{done} of {count} {what}, {(done - first) / max(now - begun, 1e-9):.1f} a second", file=sys.stderr)

    return show
