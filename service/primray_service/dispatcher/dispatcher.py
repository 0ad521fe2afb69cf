"""The dispatcher: acquires the lease when it is free, and runs a scheduler while it is held."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable
from dataclasses import asdict

from ..executor.base import Executor
from ..files import DataDirectory
from ..ids import ulid
from ..jobs import Json
from ..limits import Limits, Quotas
from ..queue.estimates import Rates
from ..store.base import Store
from .context import Calls, Context, Metrics
from .lease import Lease
from .scheduler import Scheduler

LOG = logging.getLogger(__name__)

TRY_EVERY_S = 0.5  # between attempts to acquire the lease
FAILED_PAUSE_S = 1.0  # after a scheduler that ended by an internal error


class Dispatcher:
    """One server's dispatcher; those of several servers take turns by the store's lease."""

    def __init__(
        self,
        store: Store,
        executor: Executor,
        data: DataDirectory,
        limits: Limits,
        quotas_of: Callable[[str], Quotas],
    ) -> None:
        self.metrics = Metrics()
        self.rates = Rates(store.work_seconds)
        self._store = store
        self._executor = executor
        self._data = data
        self._limits = limits
        self._quotas_of = quotas_of
        self._loop: asyncio.AbstractEventLoop | None = None
        self._scheduler: Scheduler | None = None
        self._lease: Lease | None = None
        self._stopping = asyncio.Event()
        self._ended = asyncio.Event()

    @property
    def fence(self) -> int | None:
        """Return the fence of the lease while this server holds it, for others that work under it."""
        return self._lease.fence if self._lease is not None and self._lease.is_held else None

    async def run(self) -> None:
        """Acquire the lease when it is free, and work, until `stop`."""
        self._loop = asyncio.get_running_loop()
        holder = f"{socket.gethostname()}/{os.getpid()}/{ulid(0.0)[10:]}"
        self._lease = lease = Lease(self._store, holder, self._about)
        try:
            while not self._stopping.is_set():
                if await self._has(lease):
                    await self._live(lease)
                else:
                    await self._pause(TRY_EVERY_S)
        finally:
            lease.close()
            self._ended.set()

    async def _has(self, lease: Lease) -> bool:
        try:
            return await lease.acquire()
        except Exception as error:
            LOG.warning("the lease cannot be acquired: %r", error)
            return False

    async def _live(self, lease: Lease) -> None:
        assert lease.fence is not None
        calls = Calls(lease.was_reached_since, lambda: not lease.is_held)
        context = Context(
            *(self._store, self._executor, self._data, self._limits, self._quotas_of),
            calls,
            self.metrics,
            lease.fence,
            self.rates,
        )
        self.metrics.leases += 1
        self.metrics.holds_lease = True
        self._scheduler = Scheduler(context, lease)
        try:
            if self._stopping.is_set():
                self._scheduler.stop()
            await self._scheduler.live()
            if self._scheduler.has_failed:
                await self._pause(FAILED_PAUSE_S)
        except Exception:
            LOG.exception("the dispatcher failed, and restarts")
            await self._pause(FAILED_PAUSE_S)
        finally:
            self._scheduler = None
            self.metrics.holds_lease = False
            self.metrics.running = 0
            self.metrics.leases_lost += not self._stopping.is_set()
            calls.close()
            await lease.release()

    async def _pause(self, seconds: float) -> None:
        try:
            await asyncio.wait_for(self._stopping.wait(), seconds)
        except TimeoutError:
            return

    def _about(self) -> Json:
        """Return what this server reports to others while it dispatches."""
        health = self._executor.health()
        about: Json = {"executor": asdict(self._executor.capacity()), "sandbox": health.get("sandbox", {})}
        return about | {"ok": bool(health["ok"]), "nodes": list(health.get("nodes", ()))}

    def wake(self) -> None:
        """Report that a job was queued or is to be canceled. Thread-safe. Another server may be the one that dispatches."""
        self._do_or_tell({"do": "wake"})

    def ask_preview(self, job_id: str, frame: int) -> None:
        """Ask the frame's worker to write previews because a client watches. Thread-safe."""
        self._do_or_tell({"do": "preview", "job": job_id, "frame": frame})

    def on_notice(self, words: Json) -> None:
        """Process a notice from another server. Thread-safe."""
        self._in_loop(lambda: self._do(words))

    def _do_or_tell(self, words: Json) -> None:
        if self._scheduler is None:
            self._store.tell(words)
        else:
            self.on_notice(words)

    def _do(self, words: Json) -> None:
        if self._scheduler is None:
            return
        if words.get("do") == "wake":
            self._scheduler.wake()
        elif words.get("do") == "preview":
            self._scheduler.ask_preview(str(words["job"]), int(words["frame"]))

    def _in_loop(self, work: Callable[[], None]) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(work)

    async def stop(self) -> None:
        """Let running frames write a checkpoint (a few seconds), queue them again, and release the lease."""
        self._stopping.set()
        if self._scheduler is not None:
            self._scheduler.stop()
        if self._loop is not None:
            await self._ended.wait()
