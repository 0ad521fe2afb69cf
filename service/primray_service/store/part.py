"""What the store's parts share: the database, and methods that are one transaction each."""

from __future__ import annotations

from .engine import Database


class Part:
    def __init__(self, database: Database) -> None:
        self._db = database
