"""Reads of the queue's front through an index, tenant by tenant, so that its length does not matter."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, Double, Integer, Select, Text, bindparam, func, select, tuple_

from ...jobs import JobState
from ...limits import Quotas
from ...queue.turns import Head, Line, Tenant
from ..database import schema
from .open_job import IS_ACTIVE
from .usage import utc_day

jobs, usage_days = schema.jobs, schema.usage_days

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
