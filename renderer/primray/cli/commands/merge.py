"""`primray merge`: merges checkpoints of different samples of one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...settings import RenderSettings
from .. import output_flags
from ..option_values import encoding_of, exposure_of
from ..pictures import Looks, check_outputs, is_written, write
from ..render_flags import with_own_default
from ..shots import Shot


def merge(
    parts: Annotated[
        list[Path],
        typer.Argument(metavar="PART...", help="Checkpoints written by `render --sample-range`.", show_default=False),
    ],
    outputs: Annotated[list[str], with_own_default(output_flags.Outputs)],
    checkpoint: output_flags.Checkpoint = None,
    report: output_flags.Report = None,
    display: output_flags.Display = None,
    view: output_flags.View = None,
    look: output_flags.Look = None,
    exposure: output_flags.Exposure = None,
    bit_depth: output_flags.BitDepth = None,
    half: output_flags.Half = None,
    compression: output_flags.Compression = None,
    metadata: output_flags.Metadata = None,
    make_output_path: output_flags.MakeOutputPath = False,
    json: output_flags.Json = False,
    verbose: output_flags.Verbose = False,
) -> None:
    """Merge checkpoints of different samples of one picture; the result is identical to a single render of all samples.

    Frame number placeholders in file names are filled in as by `render`.
    """
    from ...checkpoints.checkpointing import Checkpointing
    from ...checkpoints.merge import merge
    from ...render.frames import name_of_frame

    looks = Looks(
        json,
        verbose,
        view,
        display,
        look,
        exposure_of(exposure),
        make_output_path,
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
