"""What the parts of a dispatcher share during one hold of the lease."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass

from ..executor.base import Executor
from ..files import DataDirectory
from ..jobs import Frame, Job
from ..limits import Limits, Quotas
from ..store.base import Store
from .calls import Calls
from .metrics import Metrics
from .pace import Pace
from .totals import JobTotals

LOG = logging.getLogger(__name__)

PAGE = 500


@dataclass
class Parts:
    store: Store
    executor: Executor
    data: DataDirectory
    limits: Limits
    quotas_of: Callable[[str], Quotas]
    calls: Calls
    metrics: Metrics
    fence: int
    disk_is_full: bool = False  # as it was seen last

    async def look_at_disk(self) -> bool:
        """Whether so little is free that nothing new is begun."""
        was_full, free = self.disk_is_full, await self.calls.disk(self.data.free_bytes)
        self.disk_is_full = free < self.limits.free_disk_bytes
        if self.disk_is_full and not was_full:
            LOG.warning("only %d bytes are free: nothing new is rendered", free)
        return self.disk_is_full


@dataclass
class SharedJob:
    """A job of which frames run. Who writes its row holds `lock`: rows must not go back to what was known earlier."""

    totals: JobTotals
    pace: Pace
    lock: asyncio.Lock
    warning_events: int = 0


class SharedJobs:
    """The jobs of which frames run, or ran a moment ago, read once."""

    MOST = 8  # beside those that fill the slots; a job may have thousands of frames

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._jobs: dict[tuple[str, int], asyncio.Task[SharedJob]] = {}

    async def get(self, job: Job) -> SharedJob:
        key = (job.id, job.attempt)
        task = self._jobs.pop(key, None)
        if task is None or (task.done() and (task.cancelled() or task.exception() is not None)):
            task = asyncio.create_task(self._read(job))
        self._jobs[key] = task  # the last used one is the last
        while len(self._jobs) > self.MOST + self._parts.executor.capacity().slots:
            del self._jobs[next(iter(self._jobs))]
        return await asyncio.shield(task)

    def forget(self, job: Job) -> None:
        self._jobs.pop((job.id, job.attempt), None)

    async def _read(self, job: Job) -> SharedJob:
        parts = self._parts
        frames: list[Frame] = []
        while True:
            after = frames[-1].number if frames else -1
            page = await parts.calls.store(parts.store.frames, job.id, PAGE, after)
            frames.extend(page)
            if len(page) < PAGE:
                break
        return SharedJob(JobTotals(job, frames), Pace(asyncio.get_running_loop().time()), asyncio.Lock())
