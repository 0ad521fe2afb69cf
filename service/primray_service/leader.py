"""Capabilities of the leader, the server that dispatches, so that all servers give the same answers: this server, or another,
which publishes them with each renewal of its lease."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Literal

from .executor.base import Capacity
from .jobs import Json

if TYPE_CHECKING:
    from .dispatcher import Dispatcher
    from .executor.base import Executor
    from .store.base import Store

GOOD_FOR_S = 1.0
COUNTS = tuple(field.name for field in fields(Capacity))


@dataclass(frozen=True)
class Leading:
    """The leader's capabilities; `where`: whether this server dispatches, another, or none, in which case this server's are
    reported."""

    where: Literal["here", "elsewhere", "nowhere"]
    capacity: Capacity
    sandbox: Json
    nodes: Sequence[Json] = ()  # nodes where its executor has workers; none: this machine alone


class WhoLeads:
    """Lookup of the leader. Thread-safe; blocks on the database, and caches the answer for a moment."""

    def __init__(self, store: Store, dispatcher: Dispatcher, executor: Executor) -> None:
        self._store = store
        self._dispatcher = dispatcher
        self._executor = executor
        self._seen: tuple[float, Leading] | None = None
        self._lock = threading.Lock()

    def now(self) -> Leading:
        if self._dispatcher.fence is not None:
            return self._own("here")
        with self._lock:
            if self._seen is None or time.monotonic() - self._seen[0] > GOOD_FOR_S:
                self._seen = (time.monotonic(), self._look())
            return self._seen[1]

    def _look(self) -> Leading:
        leader = self._store.leader()
        if leader is None:
            return self._own("nowhere")
        said = leader.about.get("executor")
        if said is None or set(said) != set(COUNTS):  # written by another version
            return Leading("elsewhere", self._executor.capacity(), {})
        capacity = Capacity(**{name: int(said[name]) for name in COUNTS})
        return Leading("elsewhere", capacity, leader.about.get("sandbox", {}), leader.about.get("nodes", ()))

    def _own(self, where: Literal["here", "nowhere"]) -> Leading:
        health = self._executor.health()
        return Leading(where, self._executor.capacity(), health.get("sandbox", {}), health.get("nodes", ()))
