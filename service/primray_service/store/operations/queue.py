"""Waiting and running jobs in two queries, and recent durations of frames, for the positions and estimates that clients see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Connection, Select, Text, delete, select, type_coerce

from ...jobs import Frame, FrameState, Job, JobState
from ...queue.order import Waiting
from ...queue.rates import work_of_text
from ..base import QueueNow
from ..database import schema
from ..database.rows import FRAME_COLUMNS, JOB_COLUMNS, frame_of, job_of
from ..database.transaction import Transaction
from .leases import check_fence
from .open_job import IS_ACTIVE
from .operations import Operations

jobs, frames = schema.jobs, schema.frames


_WAITS = (
    select(
        *(jobs.c.id, jobs.c.tenant, jobs.c.priority, jobs.c.created_at, jobs.c.frames_queued, jobs.c.state, jobs.c.scene_id),
        type_coerce(jobs.c.settings, Text).label("settings"),  # as text: parsing ten thousand takes longer than everything else
    )
    .where(jobs.c.queue_rank.is_not(None))
    .order_by(jobs.c.queue_rank, jobs.c.created_at, jobs.c.id)
)
_RUNS: Select[Any] = select(*JOB_COLUMNS, jobs.c.frames_running).where(IS_ACTIVE, jobs.c.frames_running > 0)


class Queue(Operations):
    def running_frames(self, limit: int) -> Sequence[tuple[Job, Frame]]:
        runs = (IS_ACTIVE, frames.c.state == FrameState.RUNNING.value)
        found = select(*JOB_COLUMNS, *FRAME_COLUMNS).join(frames, frames.c.job_id == jobs.c.id).where(*runs)
        found = found.order_by(frames.c.started_at, frames.c.job_id, frames.c.number).limit(limit)
        return [(job_of(row), frame_of(row)) for row in self._db.read(lambda db: db.execute(found).all())]

    def queue(self, most: int) -> QueueNow:
        def work(db: Connection) -> QueueNow:
            waiting = [
                Waiting(
                    *(row.id, row.tenant, row.priority, row.created_at, row.frames_queued, row.state != JobState.QUEUED.value),
                    (row.scene_id, work_of_text(row.settings)),
                )
                for row in db.execute(_WAITS.limit(most))
            ]
            return QueueNow(waiting, [(job_of(row), int(row._mapping[jobs.c.frames_running])) for row in db.execute(_RUNS)])

        return self._db.read(work)


works = schema.work_seconds


class WorkSeconds(Operations):
    def note_work(self, fence: int, work: str, seconds: float, now: float, most: int) -> None:
        def noting(transaction: Transaction[Any]) -> None:
            check_fence(transaction, fence)
            transaction.execute(delete(works).where(works.c.work == work))
            transaction.insert_new(works, {"work": work, "seconds": seconds, "noted_at": now})
            newest = select(works.c.work).order_by(works.c.noted_at.desc(), works.c.work).limit(most)
            transaction.execute(delete(works).where(works.c.work.not_in(newest)))

        self._db.write(noting, durable=False)

    def work_seconds(self) -> Mapping[str, float]:
        rows = select(works.c.work, works.c.seconds).order_by(works.c.noted_at, works.c.work)
        return {work: float(seconds) for work, seconds in self._db.read(lambda db: db.execute(rows).all())}
