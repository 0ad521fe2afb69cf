"""What waits and what runs, in two queries: for the places that clients see."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Connection, Select, Text, select, type_coerce

from ....jobs import JobState
from ....waiting.order import Waiting
from ....waiting.rates import work_of_text
from ...base import QueueNow
from ...database import schema
from ...database.rows import JOB_COLUMNS, job_of
from ..open_job import IS_ACTIVE
from ..operations import Operations

jobs = schema.jobs


_WAITS = (
    select(
        *(jobs.c.id, jobs.c.tenant, jobs.c.priority, jobs.c.created_at, jobs.c.frames_queued, jobs.c.state, jobs.c.scene_id),
        type_coerce(jobs.c.settings, Text).label("settings"),  # as text: to read ten thousand takes longer than all the rest
    )
    .where(jobs.c.queue_rank.is_not(None))
    .order_by(jobs.c.queue_rank, jobs.c.created_at, jobs.c.id)
)
_RUNS: Select[Any] = select(*JOB_COLUMNS, jobs.c.frames_running).where(IS_ACTIVE, jobs.c.frames_running > 0)


class Queue(Operations):
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
