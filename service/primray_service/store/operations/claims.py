"""Claims of the next frames, several in one transaction, in the order of single claims; and which frames would be next."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from sqlalchemy import Connection, bindparam, func, select, update

from ...ids import ulid
from ...jobs import Frame, FrameState, JobState
from ...limits import Quotas
from ...queue.turns import Plan, last_turn
from ..base import Claim, Lost
from ..database import schema
from ..database.engine import Database
from ..database.rows import FRAME_COLUMNS, JOB_COLUMNS, frame_of, job_of
from ..database.transaction import Transaction
from .leases import check_fence
from .open_job import IS_ACTIVE, OpenJob, open_jobs, save_all
from .operations import Operations
from .queue_reads import FIRST_RANK, Front, QuotasOf, ranks

jobs, frames, leader = schema.jobs, schema.frames, schema.leader

FEW = 20  # waiting frames of a job: they are read together with other jobs'
NO_QUOTAS = Quotas(queued_jobs=None, stored_bytes=None)


class Claims(Operations):
    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self._claim = ""  # of a failed call: if it claimed frames, the next call returns them
        self._claiming = threading.Lock()

    def claim_frame(self, fence: int, now: float, quotas_of: QuotasOf) -> Claim | None:
        return next(iter(self.claim_frames(fence, now, quotas_of, 1)), None)

    def claim_frames(
        self,
        fence: int,
        now: float,
        quotas_of: QuotasOf,
        most: int,
        served: Mapping[str, int] | None = None,
        running: Mapping[str, int] | None = None,
    ) -> Sequence[Claim]:
        if not self._claim and not self._db.read(lambda db: _something_waits(db, fence)):
            return []
        with self._claiming:
            repeated = bool(self._claim)
            self._claim = claim = self._claim or ulid(now)

            def work(transaction: Transaction[Sequence[Claim]]) -> Sequence[Claim]:
                check_fence(transaction, fence, alone=True)
                unsure = repeated or transaction.previous is not None
                earlier = _claimed(transaction, claim) if unsure else []
                front = Front(transaction.connection, now, quotas_of, served or {}, running)
                return earlier or _claim_in(transaction, front, most, claim)

            claimed = self._db.write(work, durable=False)
            self._claim = ""
            return claimed

    def waiting(self, fence: int, now: float | None = None, quotas_of: QuotasOf | None = None) -> list[tuple[int, str]]:
        def work(db: Connection) -> list[tuple[int, str]]:
            if not _something_waits(db, fence):
                return []
            best: dict[str, int] = {}
            front = Front(db, now or 0.0, quotas_of or (lambda tenant: NO_QUOTAS))
            front.look()
            for rank in ranks(db):
                for line in front.lines(rank):
                    if line.first() is not None:
                        best.setdefault(line.tenant.name, -rank)
            return [(priority, tenant) for tenant, priority in best.items()]

        return self._db.read(work)


_LOOK = select(leader.c.fence, FIRST_RANK.scalar_subquery().label("rank")).where(leader.c.id == 1, leader.c.holder.is_not(None))


def _something_waits(db: Connection, fence: int) -> bool:
    """Return whether anything waits, without a lock, so that a vain look costs nothing. Lost."""
    held = db.execute(_LOOK).first()
    if held is None or held.fence != fence:
        raise Lost(f"fence {fence}")
    return held.rank is not None


def _claimed(transaction: Transaction[Any], claim: str) -> list[Claim]:
    """Return the frames that a failed call claimed."""
    mine = select(*FRAME_COLUMNS).join(jobs).where(IS_ACTIVE, frames.c.claim == claim)
    mine = mine.where(frames.c.state == FrameState.RUNNING.value).order_by(frames.c.job_id, frames.c.number)
    found = [frame_of(row) for row in transaction.execute(mine)]
    of = select(*JOB_COLUMNS).where(jobs.c.id.in_({frame.job_id for frame in found}))
    made = {job.id: job for job in map(job_of, transaction.execute(of))} if found else {}
    return [Claim(made[frame.job_id], frame) for frame in found]


def _claim_in(transaction: Transaction[Any], front: Front, most: int, claim: str) -> list[Claim]:
    while True:
        plan = Plan(most, last_turn(front.served))
        front.look()
        for rank in ranks(front.db):
            plan.fill(front.lines(rank))
            if plan.is_full:
                break
        if not plan.frames:
            return []
        opened = open_jobs(transaction, plan.frames)
        claimed = _claims_of(transaction, plan, opened, front.now, claim)
        if claimed:  # otherwise everything has changed since it was found: look again
            return claimed


def _claims_of(transaction: Transaction[Any], plan: Plan, opened: Mapping[str, OpenJob], now: float, claim: str) -> list[Claim]:
    wanted = {}
    for job_id, number in plan.frames.items():
        job = opened.get(job_id)
        if job is not None and job.queue_rank is not None:
            wanted[job_id] = min(number, job.frames[FrameState.QUEUED])
    begun = _begin(transaction, _next_frames(transaction, opened, wanted), now, claim)
    for job_id, new in begun.items():
        job = opened[job_id]
        job.move_frames(FrameState.QUEUED, FrameState.RUNNING, len(new))
        if job.job.state == JobState.QUEUED:
            job.move(JobState.PREPARING, now)
        for frame in new:
            job.event("frame", now, {"frame": frame.number, "state": frame.state.value, "attempt": frame.attempt})
    save_all(transaction, [opened[job_id] for job_id in wanted])
    return [Claim(opened[job_id].job, frame) for job_id in wanted for frame in begun[job_id]]


def _next_frames(
    transaction: Transaction[Any], opened: Mapping[str, OpenJob], wanted: Mapping[str, int]
) -> Mapping[str, list[Frame]]:
    """Return the first waiting frames of each job; those of small jobs in one query."""
    waits = select(*FRAME_COLUMNS).where(frames.c.state == FrameState.QUEUED.value).order_by(frames.c.job_id, frames.c.number)
    small = [job_id for job_id in wanted if opened[job_id].frames[FrameState.QUEUED] <= FEW]
    found: dict[str, list[Frame]] = {job_id: [] for job_id in wanted}
    queries = [waits.where(frames.c.job_id.in_(small))] if small else []
    queries += [waits.where(frames.c.job_id == job_id).limit(wanted[job_id]) for job_id in wanted.keys() - set(small)]
    for query in queries:
        for row in transaction.execute(query):
            if len(found[row.job_id]) < wanted[row.job_id]:
                found[row.job_id].append(frame_of(row))
    return found


def _begin(
    transaction: Transaction[Any], waiting: Mapping[str, list[Frame]], now: float, claim: str
) -> Mapping[str, list[Frame]]:
    begun = {
        job_id: [
            replace(frame, state=FrameState.RUNNING, started_at=now if frame.started_at is None else frame.started_at)
            for frame in found
        ]
        for job_id, found in waiting.items()
    }
    # One row per frame: planning time of a single statement that lists them all grows with the square of their number.
    mine = [{"of_job": frame.job_id, "of_number": frame.number} for found in begun.values() for frame in found]
    change = update(frames).where(frames.c.job_id == bindparam("of_job"), frames.c.number == bindparam("of_number"))
    if mine:
        started_at = func.coalesce(frames.c.started_at, now)
        transaction.execute(change.values(state=FrameState.RUNNING.value, started_at=started_at, claim=claim), mine)
    return begun
