"""`primray sheet`: every stage under a folder, small, on one page: to see at a glance what works and what is odd."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from .. import option_values, render_flags, stage_flags
from ..flag_defaults import with_own_default

if TYPE_CHECKING:
    from ..sheet.runs import Outcome


def sheet(
    folder: Annotated[str, typer.Argument(metavar="FOLDER", help="Its stages, and those of its folders.", show_default=False)],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="FILE", help="HTML; a JSON is put beside it.")
    ] = "sheet.html",
    width: Annotated[int, with_own_default(stage_flags.ImageWidth)] = 256,
    spp: Annotated[int, with_own_default(render_flags.Samples)] = 16,
    at_once: Annotated[int, typer.Option("--at-once", "-n", metavar="N", help="Renders at the same time.")] = 1,
    threads: render_flags.Threads = None,
    timeout: Annotated[float, typer.Option(metavar="S", help="Seconds after which a render is stopped.")] = 120.0,
    max_memory: Annotated[str, with_own_default(render_flags.MaxMemory)] = "16G",
    roots_only: Annotated[bool, typer.Option("--roots-only", help="Leave out layers that others of the folder use.")] = False,
) -> None:
    """Render every stage under a folder into a contact sheet; exit code 1 if any render fails."""
    from ...images.image import write_text
    from ...images.output_path import check_folder
    from ..json_lines import dumps
    from ..sheet.page import page
    from ..sheet.runs import Limits, render_all, stage_files

    root = Path(folder)
    stages = stage_files(root)
    if roots_only:
        from ...usd import used_files

        used = used_files([str(path) for path in stages])
        stages = [path for path in stages if str(path.resolve()) not in used]
    if not stages:
        raise SettingsError("there are no stages (usd, usda, usdc, usdz) here", where=folder, code="no-stages")
    if min(width, spp, at_once) < 1 or timeout <= 0:
        raise SettingsError("width, samples, renders at once and seconds must be above 0")
    check_folder(Path(output))
    limits = Limits(width, spp, timeout, option_values.bytes_of(max_memory) or 0, threads)
    with tempfile.TemporaryDirectory(prefix="primray-sheet-") as scratch:
        outcomes = render_all(root, stages, limits, at_once, Path(scratch), _print_outcome)
        write_text(Path(output), page(f"{root.resolve().name}: {len(outcomes)} stages", outcomes))
    write_text(Path(output).with_suffix(".json"), dumps([_as_json(outcome) for outcome in outcomes], indent=1) + "\n")
    failed = sum(outcome.failed for outcome in outcomes)
    odd = sum(bool(outcome.marks) for outcome in outcomes) - failed
    print(f"{output}: {len(outcomes)} stages, {failed} failed, {odd} odd")
    if failed:
        raise typer.Exit(1)


def _print_outcome(outcome: Outcome) -> None:
    marks = f"  {', '.join(outcome.marks)}" if outcome.marks else ""
    print(
        f"{outcome.exit_code!s:>4} {outcome.seconds:6.1f} s {outcome.peak_rss_bytes / 2**20:6.0f} MiB  {outcome.stage}{marks}",
        file=sys.stderr,
    )


def _as_json(outcome: Outcome) -> dict[str, Any]:
    return {name: value for name, value in asdict(outcome).items() if name != "picture"}
