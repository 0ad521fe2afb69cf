"""Merge of a frame's parts: a chunk in a worker that renders such parts; its messages are validated like any worker's."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from primray.sampling.schedule import FIRST_ANCHOR

from .... import ids
from ....executor.base import Ended
from ....jobs import Frame, Job, Json, Part, Scene
from ....problems import Problem
from ...chunks import commands
from ...chunks.bringing import bring
from ...chunks.chunk_run import ChunkRun
from ...chunks.messages import Checkpoint, Done, NotBelieved, mapping, number, whole
from ...context import Context
from .. import run_completion
from ..outcomes import Broken, Circumstances, Outcome, Picture, outcome_of
from .course import Judged
from .cutting import rules_of

SILENT_S = 900.0
LOOK_S = 5.0


@dataclass(frozen=True)
class Found:
    """Result of a merge about its samples."""

    checkpoint: Checkpoint
    rays: int
    error: Json | None
    judged: Judged | None  # set if an error was requested


class MergeRun:
    """Merge of parts that follow the merged samples without a gap, up to sample `end`; without parts, the error of the merged
    samples is measured again."""

    def __init__(self, context: Context, job: Job, frame: Frame, parts: Sequence[Part], scene: Scene | None) -> None:
        self.end = parts[-1].end if parts else frame.merged
        self._context = context
        self._job = job
        self._frame = frame
        self._parts = parts
        self._scene = scene
        self.run: ChunkRun | None = None
        self.ended: Ended | None = None

    async def live(self) -> Found | Outcome:
        """Run the merge; its files exist until `close`."""
        context = self._context
        try:
            if self._scene is None:
                raise Problem("internal", "The scene is not on the server any more; upload it again.")
            files = [part.checkpoint_file for part in self._parts] + [self._frame.checkpoint_file]
            await bring(context, self._scene, self._job.id, files)
            about = (self._job, self._frame, self._parts, self._scene)
            chunk = commands.merge_chunk(f"m{ids.ulid(time.time())}", *about, context.data, context.limits)
            run = self.run = ChunkRun(context.executor, chunk, self._frame.convergence)
        except (Problem, ValueError, OSError) as error:
            return run_completion.not_begun(self._frame, error, context.limits)
        while not run.is_over:
            await run.news(LOOK_S)
            if run.silent_s > SILENT_S:
                run.kill("silent")
        self.ended = ended = await run.ended()
        context.metrics.worker_cpu_s += ended.cpu_s
        circumstances = Circumstances(False, run.killed_for, await context.look_at_disk(), had_checkpoint=True)
        outcome = outcome_of(self._frame, run.inbox.last, ended, circumstances, context.limits_of_chunks)
        if not isinstance(outcome, Picture):
            return outcome
        try:
            return self._found(run, outcome.done)
        except NotBelieved:
            return Broken(Problem("render-failed", "The process that merges parts sent an invalid message.").as_json())

    def _found(self, run: ChunkRun, done: Done) -> Found:
        """Return the merge's result; raises NotBelieved unless it covers exactly the requested samples."""
        if len(run.inbox.checkpoints) != 1 or done.outputs:
            raise NotBelieved("a merge must leave one checkpoint and nothing else")
        checkpoint = run.inbox.checkpoints.popleft()
        said = mapping(done.report.get("parts"))
        if said.get("ranges") != [[0, self.end]] or checkpoint.number != self._frame.checkpoint + 1:
            raise NotBelieved("the merged samples are not the requested ones")
        error = said.get("error")
        if error is not None and number(mapping(error).get("estimate")) < 0:
            raise NotBelieved("an error is negative")
        return Found(checkpoint, whole(said.get("rays")), error, self._judged(said.get("judged")))

    def _judged(self, said: object) -> Judged | None:
        """Return the measured error. Unless the frame is complete there is a next goal, at no more than twice the samples."""
        rules = rules_of(self._job.settings.get("stop", {}))
        if rules.target is None:
            return None
        found = mapping(said)
        expected = found.get("expected")
        judged = Judged(
            found.get("target_met") is True, whole(found.get("goal")), None if expected is None else whole(expected)
        )
        is_over = judged.target_met or self.end >= rules.most
        if not is_over and not self.end < judged.goal <= max(2 * self.end, FIRST_ANCHOR):
            raise NotBelieved("the next goal is not one at which a render measures its error")
        return judged

    def kill(self, why: str) -> None:
        if self.run is not None:
            self.run.kill(why)

    async def close(self) -> None:
        if self.run is not None:
            await self.run.close()
