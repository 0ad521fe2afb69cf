"""Which frame runs next, and which would: the queue is an index, walked tenant by tenant, so its length does not matter."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from sqlalchemy import Connection, Integer, Select, cast, func, literal, select, update

from ...ids import ulid
from ...jobs import FrameState, JobState
from ...limits import Quotas
from ...waiting.order import Waiting, in_order
from ..base import Claim
from ..database import schema
from ..database.engine import Database
from ..database.rows import JOB_COLUMNS, frame_of, job_of
from ..database.transaction import Transaction
from .leases import check_fence, look_at_fence
from .open_job import IS_ACTIVE, OpenJob, open_job
from .operations import Operations
from .usage import utc_day

jobs, frames = schema.jobs, schema.frames
QuotasOf = Callable[[str], Quotas]


class Claims(Operations):
    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self._claim = ""  # of a call that failed: its frame, if it got one, is the next call's
        self._claiming = threading.Lock()

    def claim_frame(self, fence: int, now: float, quotas_of: QuotasOf) -> Claim | None:
        if not self._claim and not self._db.read(lambda db: _something_waits(db, fence)):
            return None
        with self._claiming:
            repeated = bool(self._claim)
            self._claim = self._claim or ulid(now)

            def work(transaction: Transaction[Claim | None]) -> Claim | None:
                return self._claim_in(transaction, fence, now, quotas_of, repeated)

            claimed = self._db.write(work, durable=False)
            self._claim = ""
            return claimed

    def _claim_in(
        self, transaction: Transaction[Claim | None], fence: int, now: float, quotas_of: QuotasOf, repeated: bool
    ) -> Claim | None:
        check_fence(transaction, fence, alone=True)
        if repeated or transaction.previous is not None:
            mine = select(frames).join(jobs).where(IS_ACTIVE, frames.c.claim == self._claim)
            found = transaction.execute(mine.where(frames.c.state == FrameState.RUNNING.value)).first()
            if found is not None:
                frame = frame_of(found)
                job = transaction.execute(select(*JOB_COLUMNS).where(jobs.c.id == frame.job_id)).one()
                return Claim(job_of(job), frame)
        while True:
            job_id = _best(transaction.connection, now, quotas_of)
            if job_id is None:
                return None
            opened = open_job(transaction, job_id)
            if opened is not None and opened.queue_rank is not None:  # else it changed since it was found: look again
                return _claim_of(transaction, opened, now, self._claim)

    def waiting(self, fence: int, now: float | None = None, quotas_of: QuotasOf | None = None) -> list[tuple[int, str]]:
        def work(db: Connection) -> list[tuple[int, str]]:
            if not _something_waits(db, fence):
                return []
            best: dict[str, int] = {}
            allowed = None if now is None or quotas_of is None else _Allowed(db, now, quotas_of)
            for rank in _ranks(db):
                for tenant, _ in _tenants(db, rank):
                    if tenant not in best and (allowed is None or allowed.job_of(tenant, rank) is not None):
                        best[tenant] = -rank
            return [(priority, tenant) for tenant, priority in best.items()]

        return self._db.read(work)


def _something_waits(db: Connection, fence: int) -> bool:
    """Without a lock, so that looking in vain costs nothing. Lost."""
    look_at_fence(db, fence)
    return next(_ranks(db), None) is not None


def _claim_of(transaction: Transaction[Any], opened: OpenJob, now: float, claim: str) -> Claim:
    first = select(frames).where(frames.c.job_id == opened.job.id, frames.c.state == FrameState.QUEUED.value)
    frame = frame_of(transaction.execute(first.order_by(frames.c.number).limit(1)).one())
    frame = replace(frame, state=FrameState.RUNNING, started_at=now if frame.started_at is None else frame.started_at)
    transaction.execute(
        update(frames)
        .where(frames.c.job_id == frame.job_id, frames.c.number == frame.number)
        .values(state=frame.state.value, started_at=frame.started_at, claim=claim)
    )
    opened.move_frames(FrameState.QUEUED, FrameState.RUNNING)
    if opened.job.state == JobState.QUEUED:
        opened.move(JobState.PREPARING, now)
    opened.event("frame", now, {"frame": frame.number, "state": frame.state.value, "attempt": frame.attempt})
    return Claim(opened.save(), frame)


def _ranks(db: Connection) -> Iterator[int]:
    """The queue's priorities, negated, best first: each found by one step in the index."""
    rank = None
    while True:
        least: Select[Any] = select(func.min(jobs.c.queue_rank)).where(jobs.c.queue_rank.is_not(None))
        rank = db.execute(least if rank is None else least.where(jobs.c.queue_rank > rank)).scalar()
        if rank is None:
            return
        yield int(rank)


def _tenants(db: Connection, rank: int) -> list[tuple[str, str]]:
    """Each tenant that waits at this rank, and its oldest job: one step in the index a tenant, in one recursive query."""
    at_rank = jobs.c.queue_rank == cast(literal(rank), Integer)
    steps = select(func.min(jobs.c.tenant).label("tenant")).where(at_rank).cte("steps", recursive=True)
    following = select(func.min(jobs.c.tenant)).where(at_rank, jobs.c.tenant > steps.c.tenant).scalar_subquery()
    steps = steps.union_all(select(following).where(steps.c.tenant.is_not(None)))
    oldest = (
        select(jobs.c.id)
        .where(at_rank, jobs.c.tenant == steps.c.tenant)
        .order_by(jobs.c.created_at, jobs.c.id)
        .limit(1)
        .scalar_subquery()
    )
    found = db.execute(select(steps.c.tenant, oldest.label("id")).where(steps.c.tenant.is_not(None)))
    return [(tenant, job_id) for tenant, job_id in found if job_id is not None]


class _Allowed:
    """What each tenant's quotas let it run now."""

    def __init__(self, db: Connection, now: float, quotas_of: QuotasOf) -> None:
        self._db = db
        self._quotas_of = quotas_of
        self._day = utc_day(now)
        sums = select(jobs.c.tenant, func.count(), func.sum(jobs.c.frames_running)).where(IS_ACTIVE)
        found = db.execute(sums.group_by(jobs.c.tenant)).all()
        self._jobs = {tenant: int(number) for tenant, number, _ in found}
        self.frames = {tenant: int(number) for tenant, _, number in found}  # that run
        self._out_of_time: dict[str, bool] = {}

    def job_of(self, tenant: str, rank: int, oldest: str = "") -> str | None:
        """The job that it may go on with or begin: the oldest, or the oldest of those begun if it may begin no other."""
        if self._cpu_used_up(tenant):
            return None
        most = self._quotas_of(tenant).running_jobs
        if most is None or self._jobs.get(tenant, 0) < most:
            return oldest
        begun = select(jobs.c.id).where(IS_ACTIVE, jobs.c.tenant == tenant, jobs.c.queue_rank == rank)
        found: str | None = self._db.execute(begun.order_by(jobs.c.created_at, jobs.c.id).limit(1)).scalar()
        return found

    def _cpu_used_up(self, tenant: str) -> bool:
        if tenant not in self._out_of_time:
            most = self._quotas_of(tenant).cpu_s_per_day
            days = schema.usage_days
            used = select(days.c.cpu_s).where(days.c.tenant == tenant, days.c.day == self._day)
            self._out_of_time[tenant] = most is not None and (self._db.execute(used).scalar() or 0.0) >= most
        return self._out_of_time[tenant]


def _best(db: Connection, now: float, quotas_of: QuotasOf) -> str | None:
    """The job whose frame runs next."""
    allowed = _Allowed(db, now, quotas_of)
    for rank in _ranks(db):
        found = [allowed.job_of(tenant, rank, oldest) for tenant, oldest in _tenants(db, rank)]
        candidates = [job_id for job_id in found if job_id is not None]
        if len(candidates) == 1:
            return candidates[0]
        if candidates:
            rows = db.execute(select(jobs.c.id, jobs.c.tenant, jobs.c.created_at).where(jobs.c.id.in_(candidates)))
            waiting = [Waiting(job_id, tenant, -rank, created_at) for job_id, tenant, created_at in rows]
            return in_order(waiting, allowed.frames)[0].job_id
    return None
