"""The check of one scene: a running chunk of its own kind, and the scene's rows afterwards."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Mapping
from typing import Any

from .. import ids
from ..executor.base import Chunk, Ended, Executor
from ..jobs import Json, Scene
from ..problems import Problem
from .chunks import commands, messages
from .chunks.chunk_run import LEAVE_S
from .chunks.commands import stage_inputs
from .chunks.messages import MOST_WARNINGS
from .context import Context
from .frames import outcomes

LOG = logging.getLogger(__name__)

TRIES = 2  # of a check whose worker crashes
KILLS = 5  # consecutive kills from outside


async def check_scene(context: Context, scene: Scene) -> None:
    """Run the check, repeating it after a crash or a kill, and store its result."""
    crashes = kills = 0
    while True:
        run = None
        try:
            await stage_inputs(context, scene)
            chunk = commands.check_chunk(f"k{ids.ulid(time.time())}", scene, context.data, context.limits)
            run = CheckRun(context.executor, chunk)
            ended = await run.ended()
            problem, again = _judged(context, run, ended)
        except Problem as error:
            if error.slug == "unavailable":
                return  # the scene stays unchecked; the scheduler tries again soon
            problem, again = error.as_json(), ""
        except OSError as error:
            LOG.warning("a check could not start: %s", error)
            return
        finally:
            if run is not None:
                await run.close()
        crashes += again == "crash"
        kills += again == "kill"
        if not again or crashes >= TRIES or kills >= KILLS:
            break
    facts: Json = {} if run is None else run.facts
    warnings = [] if run is None else run.warnings
    await context.calls.store(
        context.store.scene_checked,
        context.fence,
        scene.id,
        time.time(),
        facts={**scene.facts, **facts},
        warnings=warnings,
        problem=problem,
    )
    context.metrics.checks_ended["ready" if problem is None else str(problem["type"]).removeprefix("/problems/")] += 1


def _judged(context: Context, run: CheckRun, ended: Ended) -> tuple[Json | None, str]:
    """Return the scene's problem, and "crash" or "kill" if the check should be repeated."""
    limits = context.limits_of_chunks
    if isinstance(run.last, messages.Failed):
        return run.last.problem, ""
    if run.last is not None:
        return None, ""
    if run.is_not_believed or ended.protocol_error:
        return Problem("scene-rejected", "The check of the scene failed unexpectedly.").as_json(), ""
    if ended.reason in outcomes.LIMITS_REACHED:
        return outcomes.limit_problem(ended, limits, cpu_s=limits.check_cpu_s).as_json(), ""
    if outcomes.was_killed(ended):
        return outcomes.crash_problem(ended).as_json(), "kill"
    return outcomes.crash_problem(ended).as_json(), "crash"


MOST_KEPT = 500  # warnings kept


class CheckRun:
    def __init__(self, executor: Executor, chunk: Chunk) -> None:
        self.facts: Json = {}
        self.warnings: list[Json] = []
        self.last: Json | messages.Failed | None = None  # facts, or the failure
        self.is_not_believed = False
        self._said_last = asyncio.Event()
        self._warned = 0
        self._handle = executor.submit(chunk, self._on_message)
        self._ending = asyncio.create_task(self._handle.result())
        self._ending.add_done_callback(lambda _: self._said_last.set())

    def _on_message(self, message: Mapping[str, Any]) -> None:
        try:
            self._take(message)
        except messages.NotBelieved:
            self.is_not_believed = True
            self._handle.kill()

    def _take(self, message: Mapping[str, Any]) -> None:
        at = message.get("at")
        if at == "warning":
            self._warned += 1
            if self._warned > MOST_WARNINGS:
                raise messages.NotBelieved("too many warnings")
            if self._warned <= MOST_KEPT:
                self.warnings.append(messages.warning_of(message))
        elif at == "facts":
            found = messages.mapping(message)
            del found["at"]
            self.facts = self.last = found
        elif at == "failed":
            self.last = messages.failed_of(message)
        if self.last is not None:
            self._said_last.set()

    async def ended(self) -> Ended:
        await self._said_last.wait()
        if not self._ending.done():
            await asyncio.wait([self._ending], timeout=LEAVE_S)
            self._handle.kill()
        return await asyncio.shield(self._ending)

    async def close(self) -> None:
        if not self._ending.done():
            self._handle.kill()
            await asyncio.wait([self._ending])
        self._handle.release()
