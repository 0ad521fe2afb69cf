"""Notification of changes to jobs, and reads that concurrent callers share.

Long polls and event streams are woken by commits of this process, and poll the store every second for commits of other servers;
long polls less often where no other server is expected.
What they then read is loaded once for all of them; it is valid until the store reports a change of the job.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

LOOK_EVERY_S = 1.0


class Changes:
    """Waiters for changes of jobs. `changed` is thread-safe; everything else belongs to the event loop it was created in."""

    def __init__(self, look_every_s: float = LOOK_EVERY_S) -> None:
        self._loop = asyncio.get_running_loop()
        self.look_every_s = look_every_s  # for those who wait for nothing but the job
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


async def wait(event: asyncio.Event, timeout_s: float, look_every_s: float = LOOK_EVERY_S) -> None:
    """Wait until the event is set, or until it is time to poll."""
    with suppress(TimeoutError):
        await asyncio.wait_for(event.wait(), min(timeout_s, look_every_s))
    event.clear()


T = TypeVar("T")
JOBS_KEPT = 2048
THREADS = 4  # for shared reads; more threads would only compete for the interpreter's lock


class SharedReads:
    def __init__(self, age_s: float) -> None:
        self._loop = asyncio.get_running_loop()
        self._age_s = age_s
        self._slots = asyncio.Semaphore(THREADS)
        # By job id and what is read: (the loop's time when the read began, the answer).
        self._reads: OrderedDict[str, dict[Any, tuple[float, asyncio.Task[Any]]]] = OrderedDict()

    def changed(self, job_id: str) -> None:
        """Forget what was read of the job; for a store's `subscribe`."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._reads.pop, job_id, None)

    async def read(self, job_id: str, what: Any, load: Callable[[], T], age_s: float | None = None) -> T:
        """Return the result of `load`, run in a thread by the first caller. `what`: a hashable name of it."""
        age_s = self._age_s if age_s is None else age_s
        reads = self._reads.get(job_id)
        known = None if reads is None else reads.get(what)
        if known is None or self._loop.time() - known[0] > age_s:
            known = (self._loop.time(), asyncio.create_task(self._load(load)))
            self._keep(job_id, what, known)
        task: asyncio.Task[T] = known[1]
        try:
            return await asyncio.shield(task)
        except BaseException:
            if task.done() and (task.cancelled() or task.exception() is not None):
                self._reads.pop(job_id, None)  # nobody is to get an old failure
            raise

    def _keep(self, job_id: str, what: Any, read: tuple[float, asyncio.Task[Any]]) -> None:
        self._reads.setdefault(job_id, {})[what] = read
        self._reads.move_to_end(job_id)
        while len(self._reads) > JOBS_KEPT:
            self._reads.popitem(last=False)

    async def _load(self, load: Callable[[], T]) -> T:
        async with self._slots:
            return await asyncio.to_thread(load)
