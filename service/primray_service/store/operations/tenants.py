"""Tenants as an administrator sees them: their usage, and the quotas set for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sqlalchemy import Connection, delete, select, union

from ...jobs import JobState, Json
from ..base import Usage
from ..database import schema
from ..database.transaction import Transaction
from .operations import Operations
from .usage import ACTIVE, WAITING, utc_day

tenants, job_counts, usage_days = schema.tenants, schema.job_counts, schema.usage_days
api_keys, tenant_quotas = schema.api_keys, schema.tenant_quotas


class Tenants(Operations):
    def usage_of_all(self, now: float, limit: int, after: str = "") -> Sequence[tuple[str, Usage]]:
        def work(db: Connection) -> list[tuple[str, Usage]]:
            known = union(select(tenants.c.tenant), select(api_keys.c.tenant), select(tenant_quotas.c.tenant)).subquery()
            names = select(known.c.tenant).where(known.c.tenant > after).order_by(known.c.tenant).limit(limit)
            found = list(db.execute(names).scalars())
            jobs: dict[str, dict[str, int]] = {}
            for row in db.execute(select(job_counts).where(job_counts.c.tenant.in_(found))):
                jobs.setdefault(row.tenant, {})[row.state] = int(row.jobs)
            sums = {row.tenant: row for row in db.execute(select(tenants).where(tenants.c.tenant.in_(found)))}
            today = select(usage_days).where(usage_days.c.tenant.in_(found), usage_days.c.day == utc_day(now))
            spent = {row.tenant: float(row.cpu_s) for row in db.execute(today)}
            return [
                (
                    name,
                    Usage(
                        queued_jobs=_sum(jobs.get(name, {}), WAITING),
                        running_jobs=_sum(jobs.get(name, {}), ACTIVE),
                        stored_bytes=int(sums[name].stored_bytes) if name in sums else 0,
                        cpu_s_today=spent.get(name, 0.0),
                        cpu_s_total=float(sums[name].cpu_s) if name in sums else 0.0,
                    ),
                )
                for name in found
            ]

        return self._db.read(work)

    def quotas_set(self, tenant: str) -> Json:
        found = select(tenant_quotas.c.quotas).where(tenant_quotas.c.tenant == tenant)
        return self._db.read(lambda db: db.execute(found).scalar()) or {}

    def set_quotas(self, tenant: str, quotas: Json, now: float) -> None:
        def work(transaction: Transaction[None]) -> None:
            transaction.execute(delete(tenant_quotas).where(tenant_quotas.c.tenant == tenant))
            if quotas:
                transaction.insert_new(tenant_quotas, {"tenant": tenant, "quotas": quotas, "changed_at": now})

        self._db.write(work)


def _sum(counts: Mapping[str, int], states: Sequence[JobState]) -> int:
    return sum(counts.get(state.value, 0) for state in states)
