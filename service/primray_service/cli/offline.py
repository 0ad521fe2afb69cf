"""A data directory's store without a server: for the first key, and to see that a database can be used."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..store import SchemaTooNew, open_store
from ..store.base import Store
from .exits import CommandError


@contextmanager
def opened_store(url: str) -> Iterator[Store]:
    """Brought up to date, closed afterwards; CommandError where it cannot be used."""
    try:
        store = open_store(url)
        store.migrate()
    except SchemaTooNew as error:
        raise CommandError("database", f"{error}") from None
    except Exception as error:  # a driver's own, of which there are many; their texts do not hold the password
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CommandError("database", f"the database cannot be used: {reason}") from None
    try:
        yield store
    finally:
        store.close()
