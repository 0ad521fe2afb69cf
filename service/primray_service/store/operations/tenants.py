"""Tenants: their usage, their quotas as an administrator sets them, checks of both, and their API keys.

Sums are stored, never counted. Sessions that were logged out are refused by every server on this database.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, delete, func, select, union, update

from ...jobs import JobState, Json
from ...limits import Quotas
from ..base import ApiKey, QuotaExceeded, Usage
from ..database import schema
from ..database.engine import Operations, Transaction
from ..database.rows import key_of, values_of_key

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


ACTIVE = (JobState.PREPARING, JobState.RUNNING, JobState.CANCELING, JobState.PAUSING)
WAITING = (JobState.QUEUED, JobState.PAUSED)  # a paused job keeps its share of the quota: it may be resumed at any time


def utc_day(now: float) -> str:
    return datetime.fromtimestamp(now, UTC).date().isoformat()


def count_cpu(transaction: Transaction[Any], tenant: str, now: float, cpu_s: float) -> None:
    if cpu_s > 0:
        transaction.add(usage_days, {"cpu_s": cpu_s}, tenant=tenant, day=utc_day(now))
        transaction.add(tenants, {"cpu_s": cpu_s, "stored_bytes": 0}, tenant=tenant)


def count_bytes(transaction: Transaction[Any], tenant: str, number: int) -> None:
    if number != 0:
        transaction.add(tenants, {"cpu_s": 0.0, "stored_bytes": number}, tenant=tenant)


def lock_tenant(transaction: Transaction[Any], tenant: str) -> int:
    """Lock a tenant and return its stored bytes. Two requests of one tenant cannot both take the last of a quota."""
    transaction.insert_new(tenants, {"tenant": tenant, "stored_bytes": 0, "cpu_s": 0.0})
    locked = select(tenants.c.stored_bytes).where(tenants.c.tenant == tenant).with_for_update()
    return int(transaction.execute(locked).scalar_one())


def check_room_for_job(transaction: Transaction[Any], tenant: str, quotas: Quotas) -> None:
    """Check the quotas for one more queued job, which will store something. QuotaExceeded."""
    stored_bytes = lock_tenant(transaction, tenant)
    waiting = job_counts.c.state.in_([state.value for state in WAITING])
    queued = select(func.sum(job_counts.c.jobs)).where(job_counts.c.tenant == tenant, waiting)
    if quotas.queued_jobs is not None and (transaction.execute(queued).scalar() or 0) >= quotas.queued_jobs:
        raise QuotaExceeded("queued_jobs")
    if quotas.stored_bytes is not None and stored_bytes >= quotas.stored_bytes:
        raise QuotaExceeded("stored_bytes")


class Sums(Operations):
    def spend_cpu(self, tenant: str, now: float, cpu_s: float) -> None:
        self._db.write(lambda transaction: count_cpu(transaction, tenant, now, cpu_s))

    def usage(self, tenant: str, now: float) -> Usage:
        def work(db: Connection) -> Usage:
            by_state = select(job_counts.c.state, job_counts.c.jobs).where(job_counts.c.tenant == tenant)
            of_state = {state: int(number) for state, number in db.execute(by_state)}
            total = db.execute(select(tenants.c.stored_bytes, tenants.c.cpu_s).where(tenants.c.tenant == tenant)).first()
            today = select(usage_days.c.cpu_s).where(usage_days.c.tenant == tenant, usage_days.c.day == utc_day(now))
            return Usage(
                queued_jobs=sum(of_state.get(state.value, 0) for state in WAITING),
                running_jobs=sum(of_state.get(state.value, 0) for state in ACTIVE),
                stored_bytes=int(total.stored_bytes) if total else 0,
                cpu_s_today=float(db.execute(today).scalar() or 0.0),
                cpu_s_total=float(total.cpu_s) if total else 0.0,
            )

        return self._db.read(work)

    def counts(self) -> Mapping[str, int]:
        sums = select(job_counts.c.state, func.sum(job_counts.c.jobs)).group_by(job_counts.c.state)
        found = self._db.read(lambda db: db.execute(sums).all())
        return {state.value: 0 for state in JobState} | {state: int(number) for state, number in found}


class Keys(Operations):
    def create_key(self, key: ApiKey) -> None:
        def work(transaction: Transaction[None]) -> None:
            transaction.insert_new(api_keys, values_of_key(key))

        self._db.write(work)

    def key_by_sha256(self, sha256: str) -> ApiKey | None:
        found = select(api_keys).where(api_keys.c.sha256 == sha256)
        row = self._db.read(lambda db: db.execute(found).first())
        return key_of(row) if row else None

    def keys(self, tenant: str | None = None) -> Sequence[ApiKey]:
        found = select(api_keys).order_by(api_keys.c.created_at, api_keys.c.id)
        if tenant is not None:
            found = found.where(api_keys.c.tenant == tenant)
        return [key_of(row) for row in self._db.read(lambda db: db.execute(found).all())]

    def revoke_key(self, key_id: str, now: float) -> bool:
        def work(transaction: Transaction[bool]) -> bool:
            found = select(api_keys.c.revoked_at).where(api_keys.c.id == key_id).with_for_update()
            row = transaction.execute(found).first()
            if row is None or row.revoked_at is not None:
                return row is not None and row.revoked_at == now  # this very call, repeated
            transaction.execute(update(api_keys).where(api_keys.c.id == key_id).values(revoked_at=now))
            return True

        return self._db.write(work)


ended = schema.ended_sessions


class EndedSessions(Operations):
    def end_session(self, session: str, until: float, now: float) -> None:
        def work(transaction: Transaction[Any]) -> None:
            transaction.execute(delete(ended).where(ended.c.until <= now))
            transaction.insert_new(ended, {"session": session, "until": until})

        self._db.write(work)

    def session_has_ended(self, session: str) -> bool:
        found = select(ended.c.session).where(ended.c.session == session)
        return self._db.read(lambda db: db.execute(found).first()) is not None
