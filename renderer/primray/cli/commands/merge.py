"""`primray merge`: checkpoints of renders of one picture's samples to the picture of all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import options
from .render import Looks, check_outputs, write


def merge(
    parts: Annotated[
        list[Path],
        typer.Argument(metavar="PART...", help="Checkpoints, as `render --sample-range` writes them.", show_default=False),
    ],
    outputs: Annotated[
        list[str], typer.Option("--output", "-o", metavar="FILE", help="EXR, PNG or JPEG; may be repeated.", show_default=False)
    ],
    checkpoint: options.Checkpoint = None,
    report: options.Report = None,
    display: options.Display = None,
    view: options.View = None,
    look: options.Look = None,
    exposure: options.Exposure = 0.0,
    json: options.Json = False,
    verbose: options.Verbose = False,
) -> None:
    """Merge checkpoints of different samples of one picture: the bits of one render that took them all."""
    from ...checkpoints.checkpointing import Checkpointing
    from ...checkpoints.merge import merge

    looks = Looks(json, verbose, view=view, display=display, look=look, exposure=exposure)
    check_outputs(outputs, report, looks)
    if checkpoint is not None:
        Checkpointing(Path(checkpoint)).check()
    merged = merge(parts)
    write(merged.image, outputs, report, looks)
    if checkpoint is not None:
        merged.save_checkpoint(Path(checkpoint))
