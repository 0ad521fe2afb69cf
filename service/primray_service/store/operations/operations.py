"""Base of the operations: the database, and methods that are one transaction each."""

from __future__ import annotations

from ..database.engine import Database


class Operations:
    def __init__(self, database: Database) -> None:
        self._db = database
