"""The parts of a running server, by the names that routes use."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from .access.quotas import TenantQuotas
from .api.job_json import job_json
from .config import ServeConfig
from .files import DataDirectory
from .jobs import Job, Json
from .leader import WhoLeads
from .limits import Limits, Quotas
from .pictures.encoder import PictureEncoder
from .queue.positions import Positions

if TYPE_CHECKING:
    from .access.auth import Caller
    from .changes import Changes, SharedReads
    from .dispatcher import Dispatcher
    from .executor.base import Executor
    from .sandbox import SelfTest
    from .store.base import Store


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
