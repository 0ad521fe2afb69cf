"""Claims of the next frames, several in one transaction, in the order of single claims; and the queue that clients see.

The front of the queue is read through an index, tenant by tenant, so that its length does not matter. Waiting and running jobs
are read in two queries, and recent durations of frames are stored for the estimates of waiting jobs.
"""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Connection, Double, Integer, Select, Text, bindparam, delete, func, select, tuple_, type_coerce, update

from ...ids import ulid
from ...jobs import Frame, FrameState, Job, JobState
from ...limits import Quotas
from ...queue.estimates import work_of_text
from ...queue.order import Head, Line, Plan, Tenant, Waiting, last_turn
from ..base import Claim, Lost, QueueNow
from ..database import schema
from ..database.engine import Database, Operations, Transaction
from ..database.rows import FRAME_COLUMNS, JOB_COLUMNS, frame_of, job_of
from .leases import check_fence
from .open_job import IS_ACTIVE, OpenJob, open_jobs, save_all
from .tenants import utc_day

jobs, frames, leader = schema.jobs, schema.frames, schema.leader
usage_days = schema.usage_days

QuotasOf = Callable[[str], Quotas]
PAGE = 32  # of a tenant's jobs, read once those before them are planned

_HEAD = (jobs.c.tenant, jobs.c.id, jobs.c.created_at, jobs.c.frames_queued, jobs.c.state, jobs.c.parallel)


_ACTIVE = select(jobs.c.tenant, func.count(), func.sum(jobs.c.frames_running)).where(IS_ACTIVE).group_by(jobs.c.tenant)
FIRST_RANK = select(func.min(jobs.c.queue_rank)).where(jobs.c.queue_rank.is_not(None))
_NEXT_RANK = FIRST_RANK.where(jobs.c.queue_rank > bindparam("rank"))


def ranks(db: Connection) -> Iterator[int]:
    """Yield the queue's priorities, negated, best first: each found by one step in the index."""
    rank = db.execute(FIRST_RANK).scalar()
    while rank is not None:
        yield int(rank)
        rank = db.execute(_NEXT_RANK, {"rank": rank}).scalar()


def _oldest_of_each() -> Select[Any]:
    """Return a recursive query for the oldest job of each tenant: one index step for each."""
    at_rank = jobs.c.queue_rank == bindparam("rank", type_=Integer)
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
    found = select(oldest.label("id")).where(steps.c.tenant.is_not(None)).cte("oldest")
    return select(*_HEAD).join(found, found.c.id == jobs.c.id)


_OLDEST = _oldest_of_each()
_FOLLOWING = (
    select(*_HEAD)
    .where(
        jobs.c.queue_rank == bindparam("rank"),
        jobs.c.tenant == bindparam("tenant"),
        tuple_(jobs.c.created_at, jobs.c.id) > tuple_(bindparam("created_at", type_=Double), bindparam("id", type_=Text)),
    )
    .order_by(jobs.c.created_at, jobs.c.id)
    .limit(PAGE)
)


def _head(row: Any) -> Head:
    return Head(row.id, row.created_at, row.frames_queued, row.state != JobState.QUEUED.value, row.parallel is not None)


def _following(db: Connection, rank: int, tenant: str, last: Head) -> list[Head]:
    after = {"rank": rank, "tenant": tenant, "created_at": last.created_at, "id": last.job_id}
    return [_head(row) for row in db.execute(_FOLLOWING, after)]


@dataclass
class Front:
    """The waiting jobs that tenants may claim now. `running`: frames of each tenant, if the caller knows better than the rows
    do."""

    db: Connection
    now: float
    quotas_of: QuotasOf
    served: Mapping[str, int] = field(default_factory=dict)
    running: Mapping[str, int] | None = None

    def look(self) -> None:
        """Read again."""
        self._tenants: dict[str, Tenant] = {}
        self._refused: set[str] = set()  # until the end of the day
        self._active = {tenant: (int(number), int(frames)) for tenant, number, frames in self.db.execute(_ACTIVE)}

    def lines(self, rank: int) -> list[Line]:
        """Return the lines of tenants that may start a job, or continue one."""
        waiting = {row.tenant: _head(row) for row in self.db.execute(_OLDEST, {"rank": rank})}
        self._meet([name for name in waiting if name not in self._tenants and name not in self._refused])
        tenants = [self._tenants[name] for name in waiting if name in self._tenants]
        begun = self._begun(rank, [tenant.name for tenant in tenants if tenant.most_jobs is not None])
        return [self._line(rank, tenant, waiting[tenant.name], begun[tenant.name]) for tenant in tenants]

    def _line(self, rank: int, tenant: Tenant, front: Head, begun: list[Head]) -> Line:
        return Line(tenant, [front], begun, lambda last: _following(self.db, rank, tenant.name, last))

    def _meet(self, names: Collection[str]) -> None:
        quotas = {name: self.quotas_of(name) for name in names}
        limited = [name for name in names if quotas[name].cpu_s_per_day is not None]
        used: dict[str, float] = {}
        if limited:
            today = select(usage_days.c.tenant, usage_days.c.cpu_s).where(usage_days.c.day == utc_day(self.now))
            used = {row.tenant: row.cpu_s for row in self.db.execute(today.where(usage_days.c.tenant.in_(limited)))}
        for name in names:
            most = quotas[name].cpu_s_per_day
            if most is not None and used.get(name, 0.0) >= most:
                self._refused.add(name)
                continue
            number, frames = self._active.get(name, (0, 0))
            frames = frames if self.running is None else self.running.get(name, 0)
            self._tenants[name] = Tenant(name, number, frames, quotas[name].running_jobs, self.served.get(name, 0))

    def _begun(self, rank: int, names: Collection[str]) -> Mapping[str, list[Head]]:
        """Return the started jobs of these tenants."""
        found: defaultdict[str, list[Head]] = defaultdict(list)
        if names:
            begun = select(*_HEAD).where(IS_ACTIVE, jobs.c.tenant.in_(names), jobs.c.queue_rank == rank)
            for row in self.db.execute(begun):
                found[row.tenant].append(_head(row))
        return found


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
