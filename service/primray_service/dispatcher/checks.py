"""The check of one scene: a chunk of its own kind, and the scene's rows afterwards."""

from __future__ import annotations

import logging
import time

from .. import ids
from ..executor.base import Ended
from ..jobs import Json, Scene
from ..problems import Problem
from .chunks import commands, messages
from .chunks.bringing import bring
from .chunks.check_run import CheckRun
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
            await bring(context, scene)
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
