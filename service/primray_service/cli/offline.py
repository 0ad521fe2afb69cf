"""Access to a data directory's store without a server: to create the first key, and to check that a database can be used."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from ..store import SchemaTooNew, open_store
from ..store.base import Store
from .exits import CommandError

PATIENCE_S = 3.0


@contextmanager
def opened_store(url: str) -> Iterator[Store]:
    """Open the store, bring its schema up to date, and close it afterwards; CommandError if it cannot be used."""
    # A database that is just starting is waited for: report that if it takes more than a moment.
    waiting = threading.Timer(PATIENCE_S, lambda: print("waiting for the database ...", file=sys.stderr, flush=True))
    waiting.daemon = True
    waiting.start()
    try:
        store = open_store(url)
        store.migrate()
    except SchemaTooNew as error:
        raise CommandError("database", f"{error}") from None
    except Exception as error:  # drivers raise exceptions of many types; their texts do not contain the password
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CommandError("database", f"the database cannot be used: {reason}") from None
    finally:
        waiting.cancel()
    try:
        yield store
    finally:
        store.close()
