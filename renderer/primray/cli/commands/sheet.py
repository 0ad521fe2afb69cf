"""`primray sheet`: contact sheets of small pictures.

For a folder, a page with every stage; for one stage, a picture of its frames, cameras and variants.
"""

from __future__ import annotations

import json
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import SettingsError
from .. import option_values
from ..flags import in_order

if TYPE_CHECKING:
    from ..sheet_renders import Limits, Outcome, Render

PICTURES = (".png", ".jpg", ".jpeg")
PAGES = (".html", ".htm")


@in_order()
def sheet(
    source: Annotated[
        str,
        typer.Argument(
            metavar="FOLDER|SCENE", help="A folder, searched recursively for stages, or one stage.", show_default=False
        ),
    ],
    flags: Annotated[
        list[str] | None, typer.Argument(metavar="[-- FLAGS]", help="Further flags of `primray render`.", show_default=False)
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Output: HTML with a JSON beside it; for one stage also PNG or JPEG.",
            show_default="sheet.html; for one stage sheet.png",
        ),
    ] = None,
    frames: str | None = None,
    cameras: Annotated[
        list[str] | None,
        typer.Option(
            "--camera",
            "-c",
            "-cam",
            metavar="CAMERA",
            help="Camera to render, for one stage; may be repeated.",
            show_default="the stage's",
        ),
    ] = None,
    variants: Annotated[
        list[str] | None,
        typer.Option(
            "--variant",
            "--variants",
            metavar="PRIM:SET=NAME,...",
            help="Variants to render, for one stage; several sets are combined; may be repeated.",
            show_default="the stage's",
        ),
    ] = None,
    columns: Annotated[
        int | None, typer.Option(metavar="N", help="Maximum pictures per row.", show_default="depends on what varies")
    ] = None,
    image_width: int = 256,
    spp: int = 16,
    at_once: Annotated[int, typer.Option("--at-once", "-n", metavar="N", help="Number of simultaneous renders.")] = 1,
    threads: int | None = None,
    timeout: float = 120.0,
    max_memory_bytes: str = "16G",
    roots_only: Annotated[
        bool, typer.Option("--roots-only", help="Leave out layers that other stages in the folder use.")
    ] = False,
    keep: Annotated[
        str | None,
        typer.Option(
            metavar="DIR",
            help="Keep a folder's outcomes here; what has not changed since the last sheet is not rendered again.",
            show_default=False,
        ),
    ] = None,
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Render a folder's stages on the nodes of a Ray cluster: HOST:PORT, or auto on one of its nodes.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Render a contact sheet of the stages in a folder, or of one stage's frames, cameras and variants.

    The exit code is 1 if any render fails.
    """
    from ..sheet_renders import Limits

    if min(image_width, spp, at_once, 1 if columns is None else columns) < 1 or timeout <= 0:
        raise SettingsError("width, samples, simultaneous renders, columns and the time limit must be above 0")
    further, own_width, settings = _checked(flags or [], is_remote=ray is not None)
    memory = option_values.bytes_of(max_memory_bytes) or 0
    limits = Limits(
        width=own_width or image_width,
        spp=spp,
        timeout_s=timeout,
        memory_bytes=memory,
        threads=threads,
        flags=further,
        sized_by_flags=own_width is not None,
    )
    if Path(source).is_dir():
        if frames is not None or cameras or variants or columns:
            sentence = "frames, cameras, variants and columns are for the sheet of one stage, but this is a folder"
            raise SettingsError(sentence, where=source, code="sheet")
        settings = settings if own_width is not None else {**settings, "resolution": (image_width, 0)}
        remote = None if ray is None else (ray, {**settings, "spp": settings.get("spp", spp)})
        outcomes = _sheet_of_folder(Path(source), output or "sheet.html", limits, at_once, roots_only, keep, remote)
        failed = sum(outcome.failed for outcome in outcomes)
    else:
        if keep is not None:
            raise SettingsError("--keep is for the sheet of a folder, but this is a stage", where=source, code="sheet")
        if ray is not None:
            raise SettingsError("--ray is for the sheet of a folder, but this is a stage", where=source, code="sheet")
        if roots_only:
            raise SettingsError("--roots-only is for the sheet of a folder, but this is a stage", where=source, code="sheet")
        time_codes = option_values.time_codes_of(option_values.frames_of(frames, None, None, False, source, None))
        asked = (time_codes, cameras or [], variants or [], columns)
        outcomes = _sheet_of_shot(Path(source), asked, output or "sheet.png", limits, at_once)
        failed = sum(outcome.exit_code != 0 or outcome.failed for outcome in outcomes)
    if failed:
        raise typer.Exit(1)


OF_SETTINGS = frozenset({"complexity", "no_payloads", "image_width", "scene"})  # parameters that make settings


def _checked(flags: list[str], *, is_remote: bool) -> tuple[tuple[str, ...], int | None, dict[str, Any]]:
    """Return the further render flags, the width they set, if any, and their settings; a usage error for unknown flags, and
    for those that are no settings where other machines render."""
    from typer.main import get_command

    from ...settings import RenderSettings, rows
    from ..app import app
    from ..flags import setting_values
    from ..foreign_command_lines import translate_foreign_flags

    flags = translate_foreign_flags(["render", *flags])[1:]
    render = get_command(app).get_command(None, "render")  # type: ignore[attr-defined]
    with render.make_context("render", ["scene.usda", *flags]) as context:
        given = context.params
        sources = {name: context.get_parameter_source(name) for name in given}
        typed = [name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"]
    res, width = given["resolution"], given["image_width"]
    size = option_values.resolution_of(res, width)
    others = sorted(set(typed) - {row.name for row in rows(RenderSettings)} - OF_SETTINGS)
    if is_remote and others:
        sentence = f"with --ray, further flags are those of settings, which {', '.join(others)} is not"
        raise SettingsError(sentence, where="FLAGS", code="parts-setting")
    values = {name: value for name, value in setting_values(given).items() if name in typed or name == "resolution"}
    return tuple(flags), None if size is None else size[0], values if is_remote else {}


def _sheet_of_folder(
    root: Path,
    output: str,
    limits: Limits,
    at_once: int,
    roots_only: bool,
    keep: str | None,
    remote: tuple[str, dict[str, Any]] | None,
) -> list[Outcome]:
    from ...images.image import write_text
    from ..kept_outcomes import KeptOutcomes
    from ..sheet_pictures import page
    from ..sheet_renders import closed_folder, render_all, render_stage, stage_files

    stages, closed = stage_files(root)
    if root in closed:
        raise SettingsError("the folder cannot be read: permission denied", where=str(root), code="sheet")
    if roots_only:
        from ...usd import used_files

        used = used_files([str(path) for path in stages])
        stages = [path for path in stages if str(path.resolve()) not in used]
    if not stages and not closed:
        raise SettingsError("the folder has no stages (usd, usda, usdc, usdz)", where=str(root), code="no-stages")
    _check_output(output, PAGES)
    with ExitStack() as open_until_end:
        scratch = Path(open_until_end.enter_context(tempfile.TemporaryDirectory(prefix="primray-sheet-")))
        render: Render = render_stage
        if remote is not None:
            render, slots = _on_ray(*remote, open_until_end)
            at_once = max(at_once, slots)
        kept = None if keep is None else KeptOutcomes(Path(keep), render)
        one = render if kept is None else kept.render
        outcomes = render_all(root, stages, limits, at_once, scratch, _print_outcome, one)
        failed = sum(outcome.failed for outcome in outcomes)
        odd = sum(bool(outcome.marks) for outcome in outcomes) - failed
        unread = [closed_folder(root, each) for each in closed]
        for outcome in unread:
            _print_outcome(outcome)
        outcomes = [*unread, *outcomes]
        write_text(Path(output), page(f"{root.resolve().name}: {len(stages)} stages", outcomes))
    _write_json(output, outcomes)
    same = "" if kept is None else f", {kept.found} unchanged"
    folders = "1 folder" if len(unread) == 1 else f"{len(unread)} folders"
    missed = f", {folders} cannot be read" if unread else ""
    print(f"{output}: {len(stages)} stages, {failed} failed, {odd} odd{same}{missed}")
    if kept is not None and kept.problem is not None:
        print(f"warning: some outcomes are not kept: {kept.problem}", file=sys.stderr)
    return outcomes


def _on_ray(address: str, values: dict[str, Any], until: ExitStack) -> tuple[Render, int]:
    """Connect; return what renders a stage on the cluster, and how many it renders at a time."""
    from ...settings import RenderSettings
    from ..ray_sheets import RaySheet, ray_stages

    settings = RenderSettings(**values)
    executor = until.enter_context(ray_stages(address))
    return RaySheet(executor, settings).render, executor.slots()


def _sheet_of_shot(stage: Path, asked: tuple[Any, ...], output: str, limits: Limits, at_once: int) -> list[Outcome]:
    from ...images.image import write_png, write_text
    from ..sheet_pictures import contact_sheet, page, reason
    from ..sheet_renders import grid_of, render_cells, variant_choices

    time_codes, cameras, variants, columns = asked
    if not stage.exists():
        raise SettingsError("no such folder or stage", where=str(stage), code="sheet")
    grid = grid_of(time_codes, cameras, variant_choices(variants), columns)
    _check_output(output, (*PICTURES, *PAGES))
    if Path(output).suffix.lower() in PICTURES and Path(output).is_file():  # it may be a texture; other processes read these
        from ...read_files import check_kept, note_read
        from ...usd import files_to_watch

        for file in files_to_watch(str(stage)):
            note_read(file)
        check_kept()
    count = "1 picture" if len(grid.cells) == 1 else f"{len(grid.cells)} pictures"
    title = f"{stage.name}: {count}"
    with tempfile.TemporaryDirectory(prefix="primray-sheet-") as scratch:
        outcomes = render_cells(stage, grid, limits, at_once, Path(scratch), _print_outcome)
        if Path(output).suffix.lower() in PAGES:
            write_text(Path(output), page(title, outcomes))
            _write_json(output, outcomes)
        else:
            rest = iter(outcomes)
            groups = [[next(rest) for _ in group] for group in grid.groups]
            write_png(contact_sheet(title, groups, grid.columns, limits.width), Path(output))
    for outcome in outcomes:
        if outcome.exit_code != 0:
            print(f"failed: {outcome.stage}: {reason(outcome)}", file=sys.stderr)
    failed = sum(outcome.exit_code != 0 for outcome in outcomes)
    odd = sum(bool(outcome.marks) and outcome.exit_code == 0 for outcome in outcomes)
    print(f"{output}: {count}, {failed} failed, {odd} odd")
    return outcomes


def _check_output(output: str, suffixes: tuple[str, ...]) -> None:
    from ...images.output_path import check_folder

    if Path(output).suffix.lower() not in suffixes:
        sentence = f"this sheet's name must end in {', '.join(suffixes[:-1])} or {suffixes[-1]}"
        raise SettingsError(sentence, where=output, code="unknown-extension")
    check_folder(Path(output))
    if Path(output).suffix.lower() in PAGES:
        beside = _json_beside(output)
        check_folder(beside)
        if beside.exists() and not _is_of_a_sheet(beside):
            sentence = f"{beside.name} beside it, which the sheet would replace, is no sheet's: give the page another name"
            raise SettingsError(sentence, where=output, code="sheet")


def _json_beside(page: str) -> Path:
    return Path(page).with_suffix(".json")


def _is_of_a_sheet(path: Path) -> bool:
    """Return whether a file holds what `_write_json` writes."""
    try:
        rows = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return False
    return isinstance(rows, list) and all(isinstance(row, dict) and {"stage", "exit_code"} <= row.keys() for row in rows)


def _write_json(output: str, outcomes: list[Outcome]) -> None:
    from ...images.image import write_text
    from ..console import dumps

    write_text(_json_beside(output), dumps([_as_json(outcome) for outcome in outcomes], indent=1) + "\n")


def _print_outcome(outcome: Outcome) -> None:
    marks = f"  {', '.join(outcome.marks)}" if outcome.marks else ""
    print(
        f"{outcome.exit_code!s:>4} {outcome.seconds:6.1f} s {outcome.peak_rss_bytes / 2**20:6.0f} MiB  {outcome.stage}{marks}",
        file=sys.stderr,
    )


def _as_json(outcome: Outcome) -> dict[str, Any]:
    return {name: value for name, value in asdict(outcome).items() if name != "picture"}
