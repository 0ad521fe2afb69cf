"""The only SQL: what base.py         what the service asks of a store; sql_store.py is that
database/       schema.py: the tables; rows.py: between them and the service's types; migrations/, migrate.py: how they came
                about; engine.py: connections, locks, retries; transaction.py: one transaction, its events and sums; notices.py:
                what servers tell each other
operations/     open_job.py: a job under its lock, every change of one; the others are the operations
"""

from __future__ import annotations

from .database.migrate import SchemaTooNew
from .sql_store import SqlStore

__all__ = ["SchemaTooNew", "SqlStore", "open_store"]


def open_store(url: str) -> SqlStore:
    """The store at an SQLAlchemy URL, sqlite:///FILE or postgresql://...; `migrate()` it before use."""
    return SqlStore(url)
