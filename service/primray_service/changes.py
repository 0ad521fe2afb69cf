"""Waiting for a job to change: requests that poll long and event streams are woken by commits of this process, and look by
themselves every second for those of others."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress

LOOK_EVERY_S = 1.0


class Changes:
    """`changed` may be called from any thread; the rest belongs to the event loop that it was made in."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: defaultdict[str, set[asyncio.Event]] = defaultdict(set)
        self.closing = False

    def changed(self, job_id: str) -> None:
        """Wake who waits for this job; for a store's `subscribe`."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake, job_id)

    def _wake(self, job_id: str) -> None:
        for event in self._waiting.get(job_id, ()):
            event.set()

    def close(self) -> None:
        """The server is stopping: everybody wakes, and finds `closing`."""
        self.closing = True
        for job_id in list(self._waiting):
            self._wake(job_id)

    @contextmanager
    def watching(self, job_id: str) -> Iterator[asyncio.Event]:
        """An event that is set when the job changed; to be cleared before looking. Changes while inside are not missed."""
        event = asyncio.Event()
        self._waiting[job_id].add(event)
        try:
            yield event
        finally:
            self._waiting[job_id].discard(event)
            if not self._waiting[job_id]:
                del self._waiting[job_id]


async def wait(event: asyncio.Event, timeout_s: float) -> None:
    """Until the event is set, or it is time to look anyway."""
    with suppress(TimeoutError):
        await asyncio.wait_for(event.wait(), min(timeout_s, LOOK_EVERY_S))
    event.clear()
