"""`primray merge`: checkpoints of renders of one picture's samples to the picture of all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import output_flags
from ..flag_defaults import with_own_default
from ..option_values import exposure_of
from ..pictures import Looks, check_outputs, write


def merge(
    parts: Annotated[
        list[Path],
        typer.Argument(metavar="PART...", help="Checkpoints, as `render --sample-range` writes them.", show_default=False),
    ],
    outputs: Annotated[list[str], with_own_default(output_flags.Outputs)],
    checkpoint: output_flags.Checkpoint = None,
    report: output_flags.Report = None,
    display: output_flags.Display = None,
    view: output_flags.View = None,
    look: output_flags.Look = None,
    exposure: output_flags.Exposure = "0",
    make_output_path: output_flags.MakeOutputPath = False,
    json: output_flags.Json = False,
    verbose: output_flags.Verbose = False,
) -> None:
    """Merge checkpoints of different samples of one picture: the bits of one render that took them all."""
    from ...checkpoints.checkpointing import Checkpointing
    from ...checkpoints.merge import merge

    looks = Looks(json, verbose, view, display, look, exposure_of(exposure), make_output_path)
    check_outputs(outputs, report, looks)
    if checkpoint is not None:
        Checkpointing(Path(checkpoint)).check()
    merged = merge(parts)
    whole = write(merged.image, outputs, report, looks)
    if checkpoint is not None:
        merged.save_checkpoint(Path(checkpoint))
    if not whole:
        raise typer.Exit(1)
