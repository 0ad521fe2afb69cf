"""State that concurrently running frames of one job share."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from ...jobs import Frame, Job
from ..context import Context
from .report_throttle import ReportThrottle
from .totals import JobTotals

PAGE = 500


@dataclass
class SharedJob:
    """A job with running frames. Writers of its row hold `lock`, so that rows never return to an older state."""

    totals: JobTotals
    throttle: ReportThrottle
    lock: asyncio.Lock
    warning_events: int = 0


class SharedJobs:
    """Jobs with frames that run, or ran a moment ago, each read once."""

    MOST = 8  # beside those that fill the slots; a job may have thousands of frames

    def __init__(self, context: Context) -> None:
        self._context = context
        self._jobs: dict[tuple[str, int], asyncio.Task[SharedJob]] = {}

    async def get(self, job: Job) -> SharedJob:
        key = (job.id, job.attempt)
        task = self._jobs.pop(key, None)
        if task is None or (task.done() and (task.cancelled() or task.exception() is not None)):
            task = asyncio.create_task(self._read(job))
        self._jobs[key] = task  # the last used one is the last
        while len(self._jobs) > self.MOST + self._context.executor.capacity().slots:
            del self._jobs[next(iter(self._jobs))]
        return await asyncio.shield(task)

    def forget(self, job: Job) -> None:
        self._jobs.pop((job.id, job.attempt), None)

    async def _read(self, job: Job) -> SharedJob:
        context = self._context
        frames: list[Frame] = []
        while True:
            after = frames[-1].number if frames else -1
            page = await context.calls.store(context.store.frames, job.id, PAGE, after)
            frames.extend(page)
            if len(page) < PAGE:
                break
        return SharedJob(JobTotals(job, frames), ReportThrottle(asyncio.get_running_loop().time()), asyncio.Lock())
