"""The store: all operations on one database."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

from ..jobs import Json
from .database.engine import Database
from .database.migrate import migrate
from .operations.claims import Claims, Queue, WorkSeconds
from .operations.frames import Frames, Parts
from .operations.interventions import Interventions
from .operations.jobs import Jobs, Listing, Webhooks
from .operations.leases import Leases
from .operations.scenes import Contents, Scenes
from .operations.tenants import EndedSessions, Keys, Sums, Tenants


class SqlStore(
    Jobs,
    Interventions,
    Listing,
    Frames,
    Parts,
    Claims,
    Queue,
    WorkSeconds,
    Leases,
    Scenes,
    Contents,
    Sums,
    Tenants,
    Keys,
    EndedSessions,
    Webhooks,
):
    def __init__(self, url: str) -> None:
        super().__init__(Database(url))

    def migrate(self) -> None:
        migrate(self._db)

    def check(self) -> None:
        self._db.check()

    def close(self) -> None:
        self._db.close()

    def subscribe(self, on_change: Callable[[str], None]) -> Callable[[], None]:
        return self._db.subscribe(on_change)

    def listen(self, on_notice: Callable[[Json], None]) -> None:
        self._db.listen(on_notice)

    def tell(self, words: Json) -> None:
        self._db.tell(words)

    def clock(self) -> float:
        return self._db.clock()

    def exclusive(self, name: str) -> AbstractContextManager[None]:
        return self._db.exclusive(name)
