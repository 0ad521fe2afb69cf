"""Progress of a job: state that its concurrently running frames share, and reports of a frame's progress to the store.

Reports are sent at most twice a second for each job, and important changes at once.
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass, replace
from typing import Protocol

from ...jobs import Frame, Job, JobState, Json
from ..chunks.messages import Inbox
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


MOST_WARNING_EVENTS = 20  # per job; its row has the others

Event = tuple[str, Json]


class Heard(Protocol):
    """Messages of one chunk, or of all parts of a frame together."""

    @property
    def inbox(self) -> Inbox: ...


def wait_s(run: Heard, shared: SharedJob, now: float) -> float | None:
    """Return the seconds until news may be reported; None if there is none."""
    if not run.inbox.has_news:
        return None
    return 0.0 if run.inbox.is_urgent else shared.throttle.report_in(now)


async def report(context: Context, shared: SharedJob, job: Job, frame: Frame, run: Heard) -> tuple[Job, Frame]:
    """Write the news, and return the updated job and frame."""
    loop, inbox = asyncio.get_running_loop(), run.inbox
    async with shared.lock:
        inbox.has_news = inbox.is_urgent = False
        frame = updated(frame, run)
        warnings = shared.totals.add_warnings(taken_warnings(run))
        shared.totals.set(frame)
        now = time.time()
        changes: Json = {"progress": shared.totals.progress(now)}
        if warnings:
            changes["warnings"] = shared.totals.warnings
        if inbox.effective is not None and job.effective_settings is None:
            changes["effective_settings"] = inbox.effective
        if inbox.sampling_since is not None and job.state is JobState.PREPARING:
            changes["state"] = JobState.RUNNING
        events = _warning_events(shared, warnings, frame)
        if shared.throttle.takes_event("progress", loop.time()):
            events.append(("progress", changes["progress"]))
        shared.throttle.reported(loop.time(), context.metrics.running)
        job = await context.calls.store(context.store.report, context.fence, frame, now, job_changes=changes, events=events)
    return job, frame


async def tell_preview(context: Context, shared: SharedJob, frame: Frame, number: int) -> None:
    """Report a new preview; of frequent ones only some are reported."""
    loop = asyncio.get_running_loop()
    async with shared.lock:
        if shared.throttle.takes_event(f"preview {frame.number}", loop.time()):
            event = ("preview", {"frame": frame.number, "pass": number})
            await context.calls.store(context.store.report, context.fence, frame, time.time(), events=[event])


def updated(frame: Frame, run: Heard) -> Frame:
    """Return the frame with the messages of its worker applied."""
    inbox = run.inbox
    spent = {name: value for name, value in frame.progress.items() if name == "spent_s"}
    progress = frame.progress if inbox.progress is None else inbox.progress | spent
    return replace(
        frame,
        phase=inbox.phase or frame.phase,
        progress=progress,
        effective_settings=inbox.effective or frame.effective_settings,
        convergence=inbox.convergence,
    )


def taken_warnings(run: Heard) -> list[Json]:
    warnings, run.inbox.warnings = run.inbox.warnings, []
    return warnings


def _warning_events(shared: SharedJob, warnings: list[Json], frame: Frame) -> list[Event]:
    left = max(MOST_WARNING_EVENTS - shared.warning_events, 0)
    shared.warning_events += len(warnings)
    return [("warning", {**warning, "frame": frame.number}) for warning in warnings[:left]]
