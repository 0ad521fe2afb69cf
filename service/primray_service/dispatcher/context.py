"""State that the parts of a dispatcher share during one hold of the lease, and its calls of the store and the disk.

Calls run in threads of the dispatcher's own, so that they do not queue behind other parts of the server; they are repeated
when the database connection breaks.
"""

from __future__ import annotations

import asyncio
import functools
import logging
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import ParamSpec, TypeVar

from ..executor.base import Executor
from ..files import DataDirectory
from ..limits import Limits, Quotas
from ..queue.estimates import Rates
from ..store.base import Conflict, KeyReused, Lost, QuotaExceeded, Store

WAIT_S = (0.05, 0.1, 0.25, 0.5, 1.0, 5.0, 30.0, 300.0, 3600.0)
SHORT_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0)


@dataclass
class Timings:
    """Histogram: `counts[i]` observations were at most `buckets[i]` and above the bucket before; the last count has the
    others."""

    buckets: Sequence[float]
    counts: list[int] = field(default_factory=list)
    total_s: float = 0.0

    def __post_init__(self) -> None:
        self.counts = [0] * (len(self.buckets) + 1)

    def observe(self, seconds: float) -> None:
        place = next((i for i, most in enumerate(self.buckets) if seconds <= most), len(self.buckets))
        self.counts[place] += 1
        self.total_s += seconds

    @property
    def count(self) -> int:
        return sum(self.counts)


@dataclass(kw_only=True)
class Metrics:
    frames_started: int = 0
    # By the frame's state, or for failed ones by the problem's slug: "succeeded", "canceled", "memory-limit", ...
    frames_ended: Counter[str] = field(default_factory=Counter)
    # Frames queued again, by reason: "yield", "crash", "kill", "shutdown", "storage", ...
    restarts: Counter[str] = field(default_factory=Counter)
    checkpoints: int = 0
    checks_ended: Counter[str] = field(default_factory=Counter)  # "ready", or the problem's slug
    leases: int = 0  # times that this server acquired the lease, and lost it unintentionally
    leases_lost: int = 0
    holds_lease: bool = False
    running: int = 0
    worker_cpu_s: float = 0.0  # of render workers that have ended
    jobs_deleted: int = 0
    queue_wait: Timings = field(default_factory=lambda: Timings(WAIT_S))  # from queued to claimed, per frame
    first_sample: Timings = field(default_factory=lambda: Timings(WAIT_S))  # from claimed to sampling
    adopt_checkpoint: Timings = field(default_factory=lambda: Timings(SHORT_S))  # from the message to the row
    end_frame: Timings = field(default_factory=lambda: Timings(SHORT_S))  # from the last message to the row


LOG = logging.getLogger(__name__)

P = ParamSpec("P")
T = TypeVar("T")


# Exceptions that the store raises on purpose, and programming errors. All others come from the database and may be transient.
_FINAL = (
    *(Lost, Conflict, KeyReused, QuotaExceeded),
    *(LookupError, ValueError, TypeError, AttributeError, AssertionError, NotImplementedError),
)
TRIES = 6
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.05, 0.5


class Calls:
    """The threads of one dispatcher. `is_up` tells whether the database was reached after a time of the monotonic clock."""

    def __init__(self, is_up: Callable[[float], bool], is_over: Callable[[], bool]) -> None:
        self._is_up = is_up
        self._is_over = is_over
        self._database = ThreadPoolExecutor(4, "dispatcher-store")
        self._disk = ThreadPoolExecutor(3, "dispatcher-disk")

    async def store(self, method: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call a method of the store that may be repeated; raises Lost when the lease is over.

        A call that fails although the database was reached in between will fail every time, so its exception is raised.
        """
        loop = asyncio.get_running_loop()
        began, pause = loop.time(), FIRST_PAUSE_S
        failures = 0
        while True:
            if self._is_over():
                raise Lost
            try:
                return await self.store_once(method, *args, **kwargs)
            except _FINAL:
                raise
            except Exception as error:
                failures += 1
                if failures >= TRIES and self._is_up(began):
                    raise
                LOG.warning("the database failed in %s; retrying: %r", method.__name__, error)
            await asyncio.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE_S)

    async def store_once(self, method: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._database, functools.partial(method, *args, **kwargs))

    async def disk(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Do work on files, which may take a while, in a thread."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._disk, functools.partial(work, *args, **kwargs))

    def close(self) -> None:
        self._database.shutdown(wait=False)
        self._disk.shutdown(wait=False)


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
