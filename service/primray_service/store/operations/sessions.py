"""Sessions that were logged out: every server on this database refuses them."""

from __future__ import annotations

from typing import Any

from sqlalchemy import delete, select

from ..database import schema
from ..database.transaction import Transaction
from .operations import Operations

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
