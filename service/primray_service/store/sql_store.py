"""The store: all of its parts over one database."""

from __future__ import annotations

from collections.abc import Callable

from .claims import Claims
from .engine import Database
from .frames import Frames
from .jobs import Jobs
from .keys import Keys
from .leases import Leases
from .listing import Listing
from .migrate import migrate
from .scenes import Scenes
from .usage import Sums
from .webhooks import Webhooks


class SqlStore(Jobs, Listing, Frames, Claims, Leases, Scenes, Sums, Keys, Webhooks):
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
