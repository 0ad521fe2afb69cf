"""The dispatcher's lease: one row with an increasing fence, locked by all transactions under it."""

from __future__ import annotations

from typing import Any

from sqlalchemy import Connection, select, update

from ...jobs import TERMINAL, FrameState, JobState, Json
from ..base import Leader, Lost
from ..database import schema
from ..database.engine import Operations, Transaction
from .open_job import IS_ACTIVE, OpenJob, open_job

leader, jobs, frames = schema.leader, schema.jobs, schema.frames


def check_fence(transaction: Transaction[Any], fence: int, *, alone: bool = False) -> None:
    """Raise Lost unless this fence's holder dispatches; it stays so for the rest of the transaction. `alone`: exclude other
    transactions under it meanwhile."""
    held = select(leader.c.id).where(leader.c.id == 1, leader.c.fence == fence, leader.c.holder.is_not(None))
    if transaction.execute(held.with_for_update(read=not alone)).first() is None:
        raise Lost(f"fence {fence}")


def look_at_fence(db: Connection, fence: int) -> None:
    """Raise Lost unless this fence's holder dispatches now; without a lock, for reading."""
    if db.execute(select(leader.c.fence).where(leader.c.id == 1, leader.c.holder.is_not(None))).scalar() != fence:
        raise Lost(f"fence {fence}")


class Leases(Operations):
    def acquire_lease(self, holder: str, now: float, ttl_s: float, about: Json | None = None) -> int | None:
        def work(transaction: Transaction[int | None]) -> int | None:
            row = transaction.execute(select(leader).where(leader.c.id == 1).with_for_update()).one()
            if row.holder == holder and row.acquired_at == now:
                return int(row.fence)  # this very call, repeated
            if row.holder is not None and row.expires_at > now:
                return None
            fence = int(row.fence) + 1
            held: dict[str, Any] = {"fence": fence, "holder": holder, "acquired_at": now, "expires_at": now + ttl_s}
            held["about"] = about
            transaction.execute(update(leader).where(leader.c.id == 1).values(**held))
            for job_id in transaction.execute(select(jobs.c.id).where(IS_ACTIVE).order_by(jobs.c.id)).scalars().all():
                opened = open_job(transaction, job_id)
                if opened is not None and opened.job.state not in TERMINAL:
                    _take_back(transaction, opened, now)
            return fence

        return self._db.write(work)

    def renew_lease(self, fence: int, now: float, ttl_s: float, about: Json | None = None) -> None:
        renewed: dict[str, Any] = {"expires_at": now + ttl_s} | ({} if about is None else {"about": about})

        def work(transaction: Transaction[None]) -> None:
            check_fence(transaction, fence, alone=True)
            transaction.execute(update(leader).where(leader.c.id == 1).values(**renewed))

        self._db.write(work, durable=False)

    def release_lease(self, fence: int) -> None:
        def work(transaction: Transaction[None]) -> None:
            mine = update(leader).where(leader.c.id == 1, leader.c.fence == fence)
            transaction.execute(mine.values(holder=None, expires_at=0.0))

        self._db.write(work)

    def lease_expires_at(self) -> float | None:
        found = self._db.read(lambda db: db.execute(select(leader.c.holder, leader.c.expires_at)).first())
        return float(found.expires_at) if found is not None and found.holder is not None else None

    def leader(self) -> Leader | None:
        row = self._db.read(lambda db: db.execute(select(leader).where(leader.c.id == 1)).first())
        if row is None or row.holder is None:
            return None
        left_s = float(row.expires_at) - self._db.clock()
        return Leader(row.holder, left_s, row.about or {}) if left_s > 0 else None


def _take_back(transaction: Transaction[Any], opened: OpenJob, now: float) -> None:
    """Queue the frames of a dead dispatcher again; a job that was being canceled or paused becomes canceled or paused."""
    if opened.job.state == JobState.CANCELING:
        opened.cancel_frames(FrameState.RUNNING, now)
        opened.end_if_done(now, {})
        return
    running = (frames.c.job_id == opened.job.id, frames.c.state == FrameState.RUNNING.value)
    moved = transaction.execute(update(frames).where(*running).values(state=FrameState.QUEUED.value, claim="")).rowcount
    opened.move_frames(FrameState.RUNNING, FrameState.QUEUED, moved)
    if opened.job.state == JobState.PAUSING:
        opened.pause_if_idle(now)
    elif opened.job.state != JobState.QUEUED:
        opened.move(JobState.QUEUED, now)
