"""Retention: deletes expired jobs, unused scenes, files without rows, and checkpoints of ended frames if the disk is short."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

from ..files import DataDirectory
from ..jobs import TERMINAL
from ..scenes import contents, keep, shared
from ..store.base import Conflict
from .context import Context

LOG = logging.getLogger(__name__)

EXPIRE_EVERY_S = 2.0
SCENES_EVERY_S = 600.0
SWEEP_EVERY_S = 6 * 3600.0
A_TIME = 100
YOUNG_S = 120.0  # younger folders may be about to get a row
ENOUGH = 4  # times the required free bytes: below that, checkpoints of ended frames are deleted


class Retention:
    """Retention during one hold of the lease. `on_expired` gets the ids of jobs whose workers are to be killed."""

    def __init__(self, context: Context, on_expired: Callable[[str], None]) -> None:
        self._context = context
        self._on_expired = on_expired

    async def keep_on(self) -> None:
        scenes_at = sweep_at = 0.0
        loop = asyncio.get_running_loop()
        while True:
            try:
                await self.expire()
                if loop.time() >= scenes_at:
                    scenes_at = loop.time() + SCENES_EVERY_S
                    await self.remove_unused_scenes()
                    await self.remove_unused_contents()
                if loop.time() >= sweep_at:
                    sweep_at = loop.time() + SWEEP_EVERY_S
                    await self.sweep()
                await self.make_room()
            except OSError as error:
                LOG.warning("old files cannot be removed: %s", error)
            await asyncio.sleep(EXPIRE_EVERY_S)

    async def expire(self) -> None:
        context = self._context
        while True:
            expired, deleted = await context.calls.store(context.store.expire, context.fence, time.time(), A_TIME)
            for job in expired:
                self._on_expired(job.id)
            removed = 0
            for job_id in deleted:
                removed += await self._delete(job_id)
            if len(expired) < A_TIME and (len(deleted) < A_TIME or not removed):
                return

    async def _delete(self, job_id: str) -> bool:
        """Delete a job, its row first: files without a row are swept away, but a row without its files would promise missing
        data."""
        context = self._context
        try:
            await context.calls.store(context.store.delete_job, job_id)
        except Conflict:
            return False
        await context.calls.disk(context.data.remove_job, job_id)
        context.metrics.jobs_deleted += 1
        return True

    async def remove_unused_scenes(self) -> None:
        context = self._context
        before = time.time() - context.limits.default_ttl_s
        for scene in await context.calls.store(context.store.unused_scenes, context.fence, before, A_TIME):
            try:
                await context.calls.disk(keep.remove, scene.id, scene.tenant, context.store, context.data)
            except (Conflict, KeyError):
                continue  # in use, or removed by another

    async def remove_unused_contents(self) -> None:
        """Remove files uploaded by content that were never assembled into a scene, or whose scenes are gone."""
        context = self._context
        before = time.time() - context.limits.content_kept_s
        for tenant, sha256 in await context.calls.store(context.store.unused_contents, context.fence, before, A_TIME):
            await context.calls.disk(contents.forget, tenant, sha256, before, context.store, context.data)

    async def sweep(self) -> None:
        """Remove folders of jobs that have no row, and uploads and scenes without rows."""
        context = self._context
        await context.calls.disk(keep.sweep, context.store, context.data)
        await context.calls.disk(contents.sweep, context.store, context.data)
        for name in await context.calls.disk(_job_folders, context.data, time.time() - YOUNG_S):
            await self._remove_without_row(name)
        objects = context.data.objects
        if objects is not None:
            await context.calls.disk(shared.sweep, context.store, context.data)
            for name in await context.calls.disk(objects.folders, "jobs"):  # a row is older than its folder
                await self._remove_without_row(name)

    async def _remove_without_row(self, name: str) -> None:
        context = self._context
        if await context.calls.store(context.store.job, name) is None:
            await context.calls.disk(context.data.remove_job, name)

    async def make_room(self) -> None:
        """Free disk space by deleting checkpoints of ended frames: they only save time if the job is continued."""
        context = self._context
        wanted = ENOUGH * context.limits.free_disk_bytes
        await context.look_at_disk()
        if await context.calls.disk(context.data.free_bytes) >= wanted:
            return
        for path in await context.calls.disk(_checkpoints, context.data):
            job = await context.calls.store(context.store.job, path.parents[2].name)
            if job is not None and job.state in TERMINAL:
                await context.calls.disk(path.unlink, True)  # the local copy; the shared store has room
                if await context.calls.disk(context.data.free_bytes) >= wanted:
                    return


def _job_folders(data: DataDirectory, before: float) -> list[str]:
    with os.scandir(data.jobs) as entries:
        return [entry.name for entry in entries if entry.name.startswith("job_") and entry.stat().st_mtime < before]


def _checkpoints(data: DataDirectory) -> list[Path]:
    """Return the checkpoints, oldest first."""
    found = []
    for path in data.jobs.glob("*/frames/*/checkpoint-*.prc"):
        try:
            found.append((path.stat().st_mtime, path))
        except FileNotFoundError:
            continue
    return [path for _, path in sorted(found)]
