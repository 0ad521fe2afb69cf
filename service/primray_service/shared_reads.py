"""Shared reads of a job for callers that ask at the same time: clients that poll, and streams that a change has woken.

A result is valid until the store reports a change of the job, and no longer than `age_s`. Belongs to the event loop; `changed`
is thread-safe, and is called before the change is answered, so that its author reads it.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, TypeVar

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
