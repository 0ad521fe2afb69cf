"""The check of one scene: a chunk of its own kind, and what the scene's rows say afterwards."""

from __future__ import annotations

import logging
import time

from .. import ids
from ..executor.base import Ended
from ..jobs import Json, Scene
from ..problems import Problem
from . import chunks, endings, messages
from .check_run import CheckRun
from .parts import Parts

LOG = logging.getLogger(__name__)

TRIES = 2  # of a check that crashes
KILLS = 5  # from outside, in a row


async def check_scene(parts: Parts, scene: Scene) -> None:
    """Run it, again where it crashed or was killed, and write down what was found."""
    crashes = kills = 0
    while True:
        run = None
        try:
            chunk = chunks.check_chunk(f"k{ids.ulid(time.time())}", scene, parts.data, parts.limits)
            run = CheckRun(parts.executor, chunk)
            ended = await run.ended()
            problem, again = _judged(parts, run, ended)
        except Problem as error:
            if error.slug == "unavailable":
                return  # the scene waits still; somebody looks again soon
            problem, again = error.as_json(), ""
        except OSError as error:
            LOG.warning("a check could not begin: %s", error)
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
    await parts.calls.store(
        parts.store.scene_checked,
        parts.fence,
        scene.id,
        time.time(),
        facts={**scene.facts, **facts},
        warnings=warnings,
        problem=problem,
    )
    parts.metrics.checks_ended["ready" if problem is None else str(problem["type"]).removeprefix("/problems/")] += 1


def _judged(parts: Parts, run: CheckRun, ended: Ended) -> tuple[Json | None, str]:
    """The scene's problem, and whether to try again after a "crash" or a "kill"."""
    limits = parts.limits
    if isinstance(run.last, messages.Failed):
        return run.last.problem, ""
    if run.last is not None:
        return None, ""
    if run.is_not_believed or ended.protocol_error:
        return Problem("scene-rejected", "The check of the scene did not end as it should.").as_json(), ""
    if ended.reason in endings.LIMITS_REACHED:
        return endings.limit_problem(ended, limits, cpu_s=limits.check_cpu_s).as_json(), ""
    if endings.was_killed(ended):
        return endings.crash_problem(ended).as_json(), "kill"
    return endings.crash_problem(ended).as_json(), "crash"
