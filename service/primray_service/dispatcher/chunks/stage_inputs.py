"""Staging of a chunk's input files: copies from the store that servers share to this machine, before the chunk's command is
made."""

from __future__ import annotations

from collections.abc import Iterable

from ...files import DataDirectory
from ...jobs import Scene
from ...limits import Limits
from ...scenes import shared
from ..context import Context


async def stage_inputs(context: Context, scene: Scene | None, job_id: str = "", files: Iterable[str] = ()) -> None:
    """Stage the scene, and files of the job by their names in its folder ("" for none); files that exist nowhere are skipped.
    Raises Problem or OSError."""
    if context.data.objects is not None:
        await context.calls.disk(_bring, context.data, context.limits, scene, job_id, list(files))


def _bring(data: DataDirectory, limits: Limits, scene: Scene | None, job_id: str, files: Iterable[str]) -> None:
    if scene is not None:
        shared.bring(scene, data, limits)
    for name in files:
        if name:
            data.bring(data.job(job_id) / name)
