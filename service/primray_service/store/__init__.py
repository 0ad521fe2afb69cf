"""The store, and the only SQL of the service.

base.py         interface of a store; sql_store.py implements it
database/       schema.py: the tables; rows.py: their conversion to the service's types; migrations/, migrate.py: its versions;
                engine.py: connections, locks, retries, transactions; notices.py: notices between servers
operations/     open_job.py: a job under its lock, and every change of one; the others are the operations
"""

from __future__ import annotations

from .database.migrate import SchemaTooNew
from .sql_store import SqlStore

__all__ = ["SchemaTooNew", "SqlStore", "open_store"]


def open_store(url: str) -> SqlStore:
    """Return the store at an SQLAlchemy URL, sqlite:///FILE or postgresql://...; call `migrate()` before use."""
    return SqlStore(url)
