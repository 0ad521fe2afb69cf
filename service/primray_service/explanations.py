"""Pixels explained on request: `primray explain` of a job's scene in a sandboxed worker of this server, one pixel at a time.

The executor of frames may be a cluster, and is the dispatcher's: so this one is of its own, on this machine, with the same
sandbox and limits. It is started with the first request. Its worker keeps the scene open for a while, as workers of frames do.
"""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

from pydantic import ValidationError

from . import ids
from .api import views
from .config import ServeConfig
from .dispatcher.chunks import commands, messages
from .dispatcher.frames import outcomes
from .executor.base import Chunk, Ended
from .executor.local import LocalExecutor
from .files import DataDirectory
from .jobs import Frame, Job, Json, Scene
from .problems import Problem
from .store.base import Store

MOST_WAITING, MOST_OF_TENANT = 16, 4
RETRY_AFTER_S = 5
# Members of a worker's problem that an answer may have beside the standard ones.
OF_PROBLEM = ("member", "code", "where", "layer", "line", "column", "prim", "asset_path", "limit")


class Explanations:
    """Belongs to the event loop of the main thread, with which workers end."""

    def __init__(self, config: ServeConfig, data: DataDirectory, store: Store) -> None:
        self._limits, self._cores, self._data, self._store = config.limits, config.usable_cores, data, store
        self._executor: LocalExecutor | None = None
        self._one_at_a_time = asyncio.Lock()
        self._asked: Counter[str] = Counter()  # requests by tenant: those that wait, and the one that runs
        self._closing = False

    async def explain(self, job: Job, frame: Frame, scene: Scene, pixel: tuple[int, int]) -> Json:
        """Return the pixel's JSON. Its CPU time counts towards the tenant's day."""
        async with self.turn(job.tenant):
            if self._data.objects is not None:
                await asyncio.to_thread(commands.bring_inputs, self._data, self._limits, scene)
            executor = self._opened()
            name = f"x{ids.ulid(time.time())}"
            capacity = executor.capacity()
            chunk = commands.explain_chunk(name, job, frame, scene, pixel, self._data, capacity, self._limits)
            return await self._explained(executor, chunk, job.tenant)

    async def close(self) -> None:
        self._closing = True
        if self._executor is not None:
            await self._executor.close()

    @asynccontextmanager
    async def turn(self, tenant: str) -> AsyncIterator[None]:
        """Wait for the others' pixels; Problem("unavailable") if too many requests wait."""
        if self._asked.total() >= MOST_WAITING or self._asked[tenant] >= MOST_OF_TENANT:
            raise _not_now("Other pixels are being explained; repeat the request in a moment.")
        self._asked[tenant] += 1
        try:
            async with self._one_at_a_time:
                yield
        finally:
            self._asked[tenant] -= 1
            self._asked += Counter()  # drops those at 0

    def _opened(self) -> LocalExecutor:
        if self._closing:
            raise _not_now("The server is stopping.")
        if self._executor is None:
            self._executor = LocalExecutor(self._data, self._limits, slots=1, cores=self._cores, warm=False)
            self._executor.open()
        return self._executor

    async def _explained(self, executor: LocalExecutor, chunk: Chunk, tenant: str) -> Json:
        said: list[Mapping[str, Any]] = []
        try:
            handle = executor.submit(
                chunk, lambda message: said.append(message) if message["at"] in ("done", "failed") else None
            )
        except OSError as error:
            raise _not_now(f"No worker could be started: {error.strerror}.") from error
        ended = None
        try:
            ended = await handle.result()
        finally:
            if ended is None:
                handle.kill()
            handle.release()
        await asyncio.to_thread(self._store.spend_cpu, tenant, time.time(), ended.cpu_s)
        if not said:
            raise self._problem_of(ended)
        try:
            return report_of(said[0])
        except (messages.NotBelieved, ValidationError):
            raise Problem("render-failed", "The process that explains the pixel sent an invalid message.") from None

    def _problem_of(self, ended: Ended) -> Problem:
        if ended.reason == "time-limit":
            most = self._limits.explain_cpu_s
            sentence = f"The pixel, with reading its scene, took more than the {most:g} CPU seconds that are allowed."
            return Problem("time-limit", sentence, limit=most)
        if ended.reason in outcomes.LIMITS_REACHED:
            return outcomes.limit_problem(ended, self._limits)
        if ended.protocol_error:
            return Problem("render-failed", "The process that explains the pixel failed unexpectedly.")
        if outcomes.was_killed(ended):
            return _not_now("The process that explains the pixel was ended; repeat the request.")
        return outcomes.crash_problem(ended)


def report_of(message: Mapping[str, Any]) -> Json:
    """Return the pixel's JSON from a worker's last message; raises its Problem, or NotBelieved and ValidationError."""
    if message["at"] == "failed":
        document = messages.failed_of(message).problem
        slug = str(document["type"]).removeprefix("/problems/")
        more = {name: document[name] for name in OF_PROBLEM if name in document}
        raise Problem(slug, document["detail"], **more)
    report = messages.mapping(message["report"])
    views.ExplainedPixel.model_validate(report)
    return report


def _not_now(detail: str) -> Problem:
    return Problem("unavailable", detail, headers={"retry-after": str(RETRY_AFTER_S)})
