"""Webhooks to be sent: rows that were written together with the change that they report."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import Connection, literal, select, update
from sqlalchemy.sql.elements import ColumnElement

from ..base import WebhookDelivery
from ..database import schema
from ..database.rows import delivery_of
from ..database.transaction import Transaction
from .leases import check_fence, look_at_fence
from .operations import Operations

webhooks = schema.webhooks

# Must match the index's condition literally: SQLite uses a partial index for no other.
_DUE: ColumnElement[bool] = webhooks.c.state == literal("due", literal_execute=True)


class Webhooks(Operations):
    def due_webhooks(self, fence: int, now: float, limit: int) -> Sequence[WebhookDelivery]:
        def work(db: Connection) -> list[WebhookDelivery]:
            look_at_fence(db, fence)
            due = select(webhooks).where(_DUE, webhooks.c.next_at <= now)
            return [delivery_of(row) for row in db.execute(due.order_by(webhooks.c.next_at, webhooks.c.id).limit(limit))]

        return self._db.read(work)

    def webhook_tried(self, fence: int, delivery_id: str, *, state: str, next_at: float, error: str) -> None:
        def work(transaction: Transaction[None]) -> None:
            check_fence(transaction, fence)
            mine = webhooks.c.id == delivery_id
            row = transaction.execute(select(webhooks).where(mine).with_for_update()).first()
            if row is None or row.state != "due" or (row.tries > 0 and row.next_at == next_at):
                return  # deleted with its job, or this very call, repeated
            tried = {"tries": row.tries + 1, "state": state, "next_at": next_at, "last_error": error}
            transaction.execute(update(webhooks).where(mine).values(**tried))

        self._db.write(work, durable=False)

    def webhooks(self, job_id: str) -> Sequence[WebhookDelivery]:
        found = select(webhooks).where(webhooks.c.job_id == job_id).order_by(webhooks.c.id)
        return [delivery_of(row) for row in self._db.read(lambda db: db.execute(found).all())]
