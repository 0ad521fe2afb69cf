"""Adoption of a merge's files as the frame's checkpoint and preview."""

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
    """Return the frame with the checkpoint of all merged samples, which is on the disk before its row names it; None if another
    dispatcher has the frame now; an outcome that ends the frame if the checkpoint is unusable or does not fit. The files that
    it replaces are removed last (`remove_merged`)."""
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
    """Remove checkpoints that are contained in another one now; empty names are skipped."""
    for file in filter(None, files):
        await context.calls.disk(context.data.remove, context.data.job(job) / file)


async def adopt_preview_of(context: Context, job: str, frame: int, merge: MergeRun) -> int | None:
    """Return the preview's number if the merge left a usable one; pictures do not depend on it."""
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
    """Return the problem for parts that cannot be merged."""
    return Problem("render-failed", "The checkpoints of the frame's parts could not be merged.").as_json()
