"""Reports of a running frame's progress to the store: at most twice a second for each job, and important changes at once."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from typing import Protocol

from ...jobs import Frame, Job, JobState, Json
from ..chunks.inbox import Inbox
from ..context import Context
from .shared_jobs import SharedJob

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
        job = await context.calls.store(
            context.store.report, context.fence, frame, now, job_changes=changes, event=events[0] if events else None
        )
        for event in events[1:]:
            job = await context.calls.store(context.store.report, context.fence, frame, now, event=event)
    return job, frame


async def tell_preview(context: Context, shared: SharedJob, frame: Frame, number: int) -> None:
    """Report a new preview; of frequent ones only some are reported."""
    loop = asyncio.get_running_loop()
    async with shared.lock:
        if shared.throttle.takes_event(f"preview {frame.number}", loop.time()):
            event = ("preview", {"frame": frame.number, "pass": number})
            await context.calls.store(context.store.report, context.fence, frame, time.time(), event=event)


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
