"""What is not kept: jobs past their time, scenes that nobody uses, files that no row speaks of, and, where the disk is short,
checkpoints of frames that have ended."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

from ..files import DataDirectory
from ..jobs import TERMINAL
from ..scenes import keep
from ..store.base import Conflict
from . import adoption
from .parts import Parts

LOG = logging.getLogger(__name__)

EXPIRE_EVERY_S = 2.0
SCENES_EVERY_S = 600.0
SWEEP_EVERY_S = 6 * 3600.0
A_TIME = 100
YOUNG_S = 120.0  # folders so young may be about to get a row
ENOUGH = 4  # times the bytes that must be free: below, checkpoints of ended frames go


class Retention:
    """Of one hold of the lease. `on_expired` is told the ids of jobs whose workers are to be killed."""

    def __init__(self, parts: Parts, on_expired: Callable[[str], None]) -> None:
        self._parts = parts
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
                if loop.time() >= sweep_at:
                    sweep_at = loop.time() + SWEEP_EVERY_S
                    await self.sweep()
                await self.make_room()
            except OSError as error:
                LOG.warning("old files are not removed: %s", error)
            await asyncio.sleep(EXPIRE_EVERY_S)

    async def expire(self) -> None:
        parts = self._parts
        while True:
            expired, deleted = await parts.calls.store(parts.store.expire, parts.fence, time.time(), A_TIME)
            for job in expired:
                self._on_expired(job.id)
            removed = 0
            for job_id in deleted:
                removed += await self._delete(job_id)
            if len(expired) < A_TIME and (len(deleted) < A_TIME or not removed):
                return

    async def _delete(self, job_id: str) -> bool:
        """The row first: files without a row are swept away, a row without its files would promise what is not there."""
        parts = self._parts
        try:
            await parts.calls.store(parts.store.delete_job, job_id)
        except Conflict:
            return False
        await parts.calls.disk(adoption.remove_job, parts.data, job_id)
        parts.metrics.jobs_deleted += 1
        return True

    async def remove_unused_scenes(self) -> None:
        parts = self._parts
        before = time.time() - parts.limits.default_ttl_s
        for scene in await parts.calls.store(parts.store.unused_scenes, parts.fence, before, A_TIME):
            try:
                await parts.calls.disk(keep.remove, scene.id, scene.tenant, parts.store, parts.data)
            except (Conflict, KeyError):
                continue  # somebody uses it now, or removed it

    async def sweep(self) -> None:
        """Folders of jobs that have no row; uploads and scenes likewise."""
        parts = self._parts
        await parts.calls.disk(keep.sweep, parts.store, parts.data)
        for name in await parts.calls.disk(_job_folders, parts.data, time.time() - YOUNG_S):
            if await parts.calls.store(parts.store.job, name) is None:
                await parts.calls.disk(adoption.remove_job, parts.data, name)

    async def make_room(self) -> None:
        """A checkpoint of a frame that has ended saves time if its job is continued; nothing else depends on it."""
        parts = self._parts
        wanted = ENOUGH * parts.limits.free_disk_bytes
        await parts.look_at_disk()
        if await parts.calls.disk(parts.data.free_bytes) >= wanted:
            return
        for path in await parts.calls.disk(_checkpoints, parts.data):
            job = await parts.calls.store(parts.store.job, path.parents[2].name)
            if job is not None and job.state in TERMINAL:
                await parts.calls.disk(adoption.remove, path)
                if await parts.calls.disk(parts.data.free_bytes) >= wanted:
                    return


def _job_folders(data: DataDirectory, before: float) -> list[str]:
    with os.scandir(data.jobs) as entries:
        return [entry.name for entry in entries if entry.name.startswith("job_") and entry.stat().st_mtime < before]


def _checkpoints(data: DataDirectory) -> list[Path]:
    """Oldest first."""
    found = []
    for path in data.jobs.glob("*/frames/*/checkpoint-*.prc"):
        try:
            found.append((path.stat().st_mtime, path))
        except FileNotFoundError:
            continue
    return [path for _, path in sorted(found)]
