"""State that the parts of a dispatcher share during one hold of the lease."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from ..executor.base import Executor
from ..files import DataDirectory
from ..limits import Limits, Quotas
from ..queue.rates import Rates
from ..store.base import Store
from .calls import Calls
from .metrics import Metrics

LOG = logging.getLogger(__name__)


@dataclass
class Context:
    store: Store
    executor: Executor
    data: DataDirectory
    limits: Limits
    quotas_of: Callable[[str], Quotas]
    calls: Calls
    metrics: Metrics
    fence: int
    rates: Rates = field(default_factory=Rates)
    disk_is_full: bool = False  # result of the last look

    @property
    def limits_of_chunks(self) -> Limits:
        """Return the limits of chunks on this executor: a chunk may have less memory than is allowed if the nodes have less."""
        return replace(self.limits, memory_bytes=self.executor.capacity().memory_bytes)

    async def look_at_disk(self) -> bool:
        """Return whether so little disk is free that nothing new is started."""
        was_full, free = self.disk_is_full, await self.calls.disk(self.data.free_bytes)
        self.disk_is_full = free < self.limits.free_disk_bytes
        if self.disk_is_full and not was_full:
            LOG.warning("only %d bytes of disk are free: no new renders are started", free)
        return self.disk_is_full
