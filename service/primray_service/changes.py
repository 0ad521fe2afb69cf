"""Notification of changes to jobs: long polls and event streams are woken by commits of this process, and poll the store every
second for commits of other servers."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress

LOOK_EVERY_S = 1.0


class Changes:
    """Waiters for changes of jobs. `changed` is thread-safe; everything else belongs to the event loop it was created in."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: defaultdict[str, set[asyncio.Event]] = defaultdict(set)
        self.closing = False

    def changed(self, job_id: str) -> None:
        """Wake those who wait for this job; for a store's `subscribe`."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake, job_id)

    def _wake(self, job_id: str) -> None:
        for event in self._waiting.get(job_id, ()):
            event.set()

    def close(self) -> None:
        """Wake all waiters because the server stops; they check `closing`."""
        self.closing = True
        for job_id in list(self._waiting):
            self._wake(job_id)

    @contextmanager
    def watching(self, job_id: str) -> Iterator[asyncio.Event]:
        """Provide an event that is set when the job changes; clear it before reading the job. Changes inside the block are not
        missed."""
        event = asyncio.Event()
        self._waiting[job_id].add(event)
        try:
            yield event
        finally:
            self._waiting[job_id].discard(event)
            if not self._waiting[job_id]:
                del self._waiting[job_id]


async def wait(event: asyncio.Event, timeout_s: float) -> None:
    """Wait until the event is set, or until it is time to poll."""
    with suppress(TimeoutError):
        await asyncio.wait_for(event.wait(), min(timeout_s, LOOK_EVERY_S))
    event.clear()
