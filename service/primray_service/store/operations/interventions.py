"""Interventions of people in jobs: pause, resume, and render one frame again."""

from __future__ import annotations

from typing import Any

from sqlalchemy import delete, select, update

from ...jobs import FRAME_TERMINAL, TERMINAL, Frame, FrameState, Job, JobState
from ...limits import Quotas
from ..base import Conflict
from ..database import schema
from ..database.engine import Operations, Transaction
from ..database.rows import FRAME_COLUMNS, JOB_COLUMNS, frame_of
from .open_job import OpenJob, open_known_job
from .scenes import lock_scene
from .tenants import check_room_for_job

jobs, frames, parts = schema.jobs, schema.frames, schema.parts


class Interventions(Operations):
    def request_pause(self, job_id: str, now: float) -> Job:
        def work(transaction: Transaction[Job]) -> Job:
            opened = open_known_job(transaction, job_id)
            if opened.job.state in (JobState.PAUSING, JobState.PAUSED):
                return opened.job
            if opened.job.state in TERMINAL or opened.job.state == JobState.CANCELING:
                raise Conflict(f"{job_id} is {opened.job.state}")
            to = JobState.PAUSING if opened.frames[FrameState.RUNNING] else JobState.PAUSED
            opened.move(to, now, {"expires_at": now + opened.job.ttl_s})
            return opened.save()

        return self._db.write(work)

    def request_resume(self, job_id: str, now: float) -> Job:
        def work(transaction: Transaction[Job]) -> Job:
            opened = open_known_job(transaction, job_id)
            job = opened.job
            if job.state == JobState.PAUSED:
                opened.move(JobState.QUEUED, now, {"queued_at": now, "expires_at": now + job.ttl_s})
            elif job.state == JobState.PAUSING:  # its frames return to the queue, and are claimed again
                to = JobState.PREPARING if job.started_at is None else JobState.RUNNING
                opened.move(to, now, {"expires_at": now + job.ttl_s})
            elif job.state in TERMINAL or job.state == JobState.CANCELING:
                raise Conflict(f"{job_id} is {job.state}")
            return opened.save()

        return self._db.write(work)

    def retry_frame(self, job_id: str, number: int, attempt: int, now: float, quotas: Quotas) -> Job:
        def work(transaction: Transaction[Job]) -> Job:
            found = transaction.execute(select(*JOB_COLUMNS).where(jobs.c.id == job_id)).first()
            if found is None:
                raise KeyError(job_id)
            scene = lock_scene(transaction, found.tenant, found.scene_id, used_at=now)
            opened = open_known_job(transaction, job_id)
            frame = _frame(transaction, job_id, number)
            if frame.attempt == attempt + 1 and transaction.previous is not None:
                return opened.job  # this very call, repeated
            if frame.attempt != attempt or frame.state not in FRAME_TERMINAL or opened.job.state == JobState.CANCELING:
                raise Conflict(f"frame {number} of {job_id} is {frame.state}, in attempt {frame.attempt}")
            if scene is None or scene.state == "rejected":
                raise Conflict(f"the scene of {job_id} was deleted, or cannot be rendered")
            _queue_again(transaction, opened, frame)
            if opened.job.state in TERMINAL:
                check_room_for_job(transaction, opened.job.tenant, quotas)
                _reopen(opened, now)
                opened.scene_ready = scene.state == "ready"
            opened.event("frame", now, {"frame": number, "state": FrameState.QUEUED.value, "attempt": attempt + 1})
            return opened.save()

        return self._db.write(work)


def _frame(transaction: Transaction[Any], job_id: str, number: int) -> Frame:
    found = select(*FRAME_COLUMNS).where(frames.c.job_id == job_id, frames.c.number == number)
    row = transaction.execute(found).first()
    if row is None:
        raise KeyError(f"{job_id}, frame {number}")
    return frame_of(row)


def _queue_again(transaction: Transaction[Any], opened: OpenJob, frame: Frame) -> None:
    """Queue the frame without a checkpoint; its outputs stay until new ones replace them, and its CPU seconds stay counted."""
    begun = {
        "state": FrameState.QUEUED.value,
        "attempt": frame.attempt + 1,
        "checkpoint": 0,
        "checkpoint_file": "",
        "checkpoint_chunk": "",
        "merged": 0,
        "claim": "",
        "crashes": 0,
        "kills": 0,
        "phase": "",
        "progress": {},
        "convergence": [],
        "result": None,
        "error": None,
        "started_at": None,
        "finished_at": None,
    }
    mine = (frames.c.job_id == frame.job_id, frames.c.number == frame.number)
    transaction.execute(update(frames).where(*mine).values(**begun))
    transaction.execute(delete(parts).where(parts.c.job_id == frame.job_id, parts.c.frame == frame.number))
    opened.move_frames(frame.state, FrameState.QUEUED)


def _reopen(opened: OpenJob, now: float) -> None:
    """Queue a job that had ended again, in the same attempt: its other frames stay as they are."""
    job, counts = opened.job, opened.counts
    done = counts["total"] - counts[FrameState.QUEUED.value]
    progress = {**job.progress, "fraction": done / counts["total"], "phase": "queued", "frames": counts}
    again = {"queued_at": now, "expires_at": now + job.ttl_s, "finished_at": None}
    opened.move(JobState.QUEUED, now, {**again, "progress": progress, "result": None, "error": None})
