"""The parts of a running server, by the names that routes use; and the capabilities of the server that dispatches.

The leader is the server that dispatches: this one, or another, which publishes its capabilities with each renewal of its lease.
All servers report those, so that all give the same answers.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from .api.job_json import job_json
from .config import ServeConfig
from .executor.base import Capacity
from .files import DataDirectory
from .jobs import Job, Json
from .limits import Limits, Quotas
from .pictures.encoder import PictureEncoder
from .queue.estimates import Positions
from .quotas import TenantQuotas

if TYPE_CHECKING:
    from .auth import Caller
    from .changes import Changes, SharedReads
    from .dispatcher import Dispatcher
    from .executor.base import Executor
    from .explanations import Explanations
    from .sandbox import SelfTest
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


@dataclass
class Service:
    config: ServeConfig
    store: Store
    data: DataDirectory
    executor: Executor
    dispatcher: Dispatcher
    changes: Changes  # waiters for changes of jobs
    reads: SharedReads  # shared by concurrent readers of a job
    self_test: SelfTest | None = None  # result for the sandbox, at the start; None: this server runs no workers
    pictures: PictureEncoder = field(default_factory=PictureEncoder)
    explanations: Explanations | None = None  # None: this server runs no workers

    @cached_property
    def who_leads(self) -> WhoLeads:
        return WhoLeads(self.store, self.dispatcher, self.executor)

    @cached_property
    def positions(self) -> Positions:
        """Return the positions of queued jobs."""
        return Positions(self.store, lambda: self.who_leads.now().capacity.slots, self.dispatcher.rates)

    def job_json(self, job: Job) -> Json:
        """Return a job's JSON with its position in the queue; blocks on the database."""
        return job_json(job, self.positions.of(job))

    @property
    def limits(self) -> Limits:
        return self.config.limits

    @property
    def quotas(self) -> Quotas:
        return self.config.quotas

    @cached_property
    def tenant_quotas(self) -> TenantQuotas:
        return TenantQuotas(self.store, self.config.quotas)

    def quotas_of(self, caller: Caller) -> Quotas:
        """Return a caller's quotas; blocks on the database unless they were read a moment ago."""
        return self.tenant_quotas.of_caller(caller)
