"""What waits and what runs, in two queries: for the places that clients see."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Connection, Select, select

from ...jobs import JobState
from ...waiting.order import Waiting
from ...waiting.rates import work_of
from ..base import QueueNow
from ..database import schema
from ..database.rows import JOB_COLUMNS, job_of
from .open_job import IS_ACTIVE
from .operations import Operations

jobs = schema.jobs


class Queue(Operations):
    def queue(self, most: int) -> QueueNow:
        waits: Select[Any] = select(*JOB_COLUMNS, jobs.c.frames_queued).where(jobs.c.queue_rank.is_not(None))
        waits = waits.order_by(jobs.c.queue_rank, jobs.c.created_at, jobs.c.id).limit(most)
        runs: Select[Any] = select(*JOB_COLUMNS, jobs.c.frames_running).where(IS_ACTIVE, jobs.c.frames_running > 0)

        def work(db: Connection) -> QueueNow:
            waiting = []
            for row in db.execute(waits):
                job, frames = job_of(row), int(row._mapping[jobs.c.frames_queued])
                begun = job.state != JobState.QUEUED
                waiting.append(Waiting(job.id, job.tenant, job.priority, job.created_at, frames, begun, work_of(job)))
            return QueueNow(waiting, [(job_of(row), int(row._mapping[jobs.c.frames_running])) for row in db.execute(runs)])

        return self._db.read(work)
