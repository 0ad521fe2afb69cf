"""Rows of API keys, and of sessions that were logged out, which every server on this database refuses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import delete, select, update

from ..base import ApiKey
from ..database import schema
from ..database.rows import key_of, values_of_key
from ..database.transaction import Transaction
from .operations import Operations

api_keys = schema.api_keys


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
