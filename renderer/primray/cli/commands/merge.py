"""`primray merge`: merges checkpoints of different samples of one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...settings import RenderSettings
from ..flags import in_order
from ..option_values import encoding_of, exposure_of
from ..pictures import Looks, check_outputs, is_written, write
from ..shots import Shot


@in_order()
def merge(
    parts: Annotated[
        list[Path],
        typer.Argument(metavar="PART...", help="Checkpoints written by `render --sample-range`.", show_default=False),
    ],
    outputs: list[str],
    checkpoint: str | None = None,
    report: str | None = None,
    display: str | None = None,
    view: str | None = None,
    look: str | None = None,
    exposure: str | None = None,
    bit_depth: int | None = None,
    half: list[str] | None = None,
    compression: str | None = None,
    metadata: list[str] | None = None,
    make_output_path: bool = False,
    json: bool = False,
    verbose: bool = False,
) -> None:
    """Merge checkpoints of different samples of one picture; the result is identical to a single render of all samples.

    Frame number placeholders in file names are filled in as by `render`.
    """
    from ...checkpoints.checkpointing import Checkpointing
    from ...checkpoints.merge import merge
    from ...render.frames import name_of_frame

    looks = Looks(
        as_json=json,
        verbose=verbose,
        view=view,
        display=display,
        look=look,
        exposure=exposure_of(exposure),
        make_folders=make_output_path,
        encoding=encoding_of(bit_depth, half, compression, metadata),
    )
    check_outputs(outputs, report, looks)
    if checkpoint is not None:
        Checkpointing(Path(checkpoint)).check()
    merged = merge(parts)
    frame = merged.time_code
    files = [name_of_frame(name, frame) for name in outputs]
    saved = None if checkpoint is None else Path(name_of_frame(checkpoint, frame))
    if saved is not None:
        Checkpointing(saved).check()
    whole = saved is None or is_written(lambda: merged.save_checkpoint(saved), looks)
    shot = Shot(RenderSettings(time_code=frame), files, name_of_frame(report, frame) if report else None)
    whole = write(merged.image, shot, looks) and whole
    if not whole:
        raise typer.Exit(1)
