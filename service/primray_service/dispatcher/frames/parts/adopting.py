"""What a merge of parts left becomes the frame's: its checkpoint, and its preview."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from ....jobs import Frame, Job, Json
from ....problems import Problem
from ...chunks import adoption
from ...context import Context
from ..outcomes import Again, Broken, Outcome
from .merge_run import Found, MergeRun


async def adopt_merge(context: Context, job: Job, frame: Frame, merge: MergeRun, found: Found) -> Frame | Outcome | None:
    """The frame with the checkpoint of all that is merged: on the disk first, then in the row. None: another dispatcher has it
    now. An outcome ends it: the checkpoint is unusable, or has no room. What it is made of goes last (`remove_merged`)."""
    run = merge.run
    assert run is not None
    name = adoption.checkpoint_file(found.checkpoint.number, frame.number, run.chunk.id)
    file = context.data.job(job.id) / name
    try:
        source = run.handle.folder / found.checkpoint.file
        await context.calls.disk(adoption.adopt_checkpoint, context.data, source, file, context.limits.output_bytes)
    except adoption.NotAdopted:
        return Broken(unusable())
    except OSError:
        context.disk_is_full = True
        return Again(frame, "storage")
    accepted = await context.calls.store(
        context.store.accept_checkpoint,
        context.fence,
        f"{run.chunk.id}-{found.checkpoint.number}",
        job.id,
        frame.number,
        attempt=frame.attempt,
        follows=frame.checkpoint,
        file=name,
        now=time.time(),
        merged=merge.end,
    )
    if not accepted:
        await context.calls.disk(context.data.remove, file)
        return None
    context.metrics.checkpoints += 1
    return replace(frame, checkpoint=found.checkpoint.number, checkpoint_file=name, merged=merge.end, crashes=0, kills=0)


async def remove_merged(context: Context, job: str, files: Sequence[str]) -> None:
    """Checkpoints that another one holds now; names that are empty are none."""
    for file in filter(None, files):
        await context.calls.disk(context.data.remove, context.data.job(job) / file)


async def adopt_preview_of(context: Context, job: str, frame: int, merge: MergeRun) -> int | None:
    """Its number, if the merge left one that could be taken: nobody's picture depends on it."""
    assert merge.run is not None
    preview = merge.run.inbox.preview
    if preview is None:
        return None
    try:
        source = merge.run.handle.folder / preview.file
        folder = context.data.frame(job, frame)
        taken = await context.calls.disk(adoption.adopt_preview, context.data, source, folder)
    except (adoption.NotAdopted, OSError):
        return None
    return preview.number if taken else None


def unusable() -> Json:
    """The problem of parts that cannot be put together."""
    return Problem("render-failed", "What the parts of the frame left could not be put together.").as_json()
