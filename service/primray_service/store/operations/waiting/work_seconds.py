"""Recent durations of frames as the dispatching server measured them, for all estimates, and for the next dispatcher."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import delete, select

from ...database import schema
from ...database.transaction import Transaction
from ..leases import check_fence
from ..operations import Operations

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
