"""State that concurrently running frames of one job share, with the rate limit of the job's progress reports."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from ...jobs import Frame, Job
from ..context import Context
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


SOONEST_S = 0.5
MOST_A_SECOND = 50.0  # reports of all frames; more would delay claims and ends
LATEST_S = 10.0
OF_ELAPSED = 0.02


class ReportThrottle:
    """Rate limit of one job. Times are of any monotonic clock."""

    def __init__(self, began: float) -> None:
        self._began = began
        self._report_at = began
        self._event_at: dict[str, float] = {}

    def report_in(self, now: float) -> float:
        """Return the seconds until the job's row may be written again."""
        return max(self._report_at - now, 0.0)

    def reported(self, now: float, running: int = 1) -> None:
        """Record a report; `running` is the number of running frames of all jobs, which share the database's capacity."""
        self._report_at = now + max(SOONEST_S, running / MOST_A_SECOND)

    def takes_event(self, kind: str, now: float) -> bool:
        """Return whether an event of this kind is due; if so, the next one is due later."""
        if now < self._event_at.get(kind, self._began):
            return False
        self._event_at[kind] = now + min(max(OF_ELAPSED * (now - self._began), SOONEST_S), LATEST_S)
        return True
