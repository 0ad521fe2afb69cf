"""Merges of a frame's parts: their pace, their chunks, and the adoption of their checkpoints.

A merge is a chunk in a worker that renders such parts; its messages are validated like any worker's. Merges that nothing waits
for update previews and the current error.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from primray.sampling.schedule import FIRST_ANCHOR

from ... import ids
from ...executor.base import Ended
from ...jobs import Frame, Job, Json, Part, Scene
from ...problems import Problem
from ..chunks import adoption, commands
from ..chunks.chunk_run import ChunkRun
from ..chunks.commands import stage_inputs
from ..chunks.messages import Checkpoint, Done, NotBelieved, mapping, number, whole
from ..context import Context
from ..frames import run_completion
from ..frames.outcomes import Again, Broken, Circumstances, Outcome, Picture, outcome_of
from .plan import Judged, rules_of

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
            await stage_inputs(context, self._scene, self._job.id, files)
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


async def adopt_merge(context: Context, job: Job, frame: Frame, merge: MergeRun, found: Found) -> Frame | Outcome | None:
    """Return the frame with the checkpoint of all merged samples, which is on the disk before its row names it; None if another
    dispatcher has the frame now; an outcome that ends the frame if the checkpoint is unusable or does not fit. The files that
    it replaces are removed last (`remove_merged`)."""
    run = merge.run
    assert run is not None
    name = adoption.checkpoint_file(found.checkpoint.number, frame.number, run.chunk.id)
    file = context.data.job(job.id) / name
    try:
        source = run.handle.folder / found.checkpoint.file
        await context.calls.disk(adoption.adopt_checkpoint, context.data, source, file, context.limits.output_bytes)
    except adoption.NotAdopted:
        return Broken(unusable())
    except OSError:
        context.disk_is_full = True
        return Again(frame, "storage")
    accepted = await context.calls.store(
        context.store.accept_checkpoint,
        context.fence,
        f"{run.chunk.id}-{found.checkpoint.number}",
        job.id,
        frame.number,
        attempt=frame.attempt,
        follows=frame.checkpoint,
        file=name,
        now=time.time(),
        merged=merge.end,
    )
    if not accepted:
        await context.calls.disk(context.data.remove, file)
        return None
    context.metrics.checkpoints += 1
    return replace(frame, checkpoint=found.checkpoint.number, checkpoint_file=name, merged=merge.end, crashes=0, kills=0)


async def remove_merged(context: Context, job: str, files: Sequence[str]) -> None:
    """Remove checkpoints that are contained in another one now; empty names are skipped."""
    for file in filter(None, files):
        await context.calls.disk(context.data.remove, context.data.job(job) / file)


async def adopt_preview_of(context: Context, job: str, frame: int, merge: MergeRun) -> int | None:
    """Return the preview's number if the merge left a usable one; pictures do not depend on it."""
    assert merge.run is not None
    preview = merge.run.inbox.preview
    if preview is None:
        return None
    try:
        source = merge.run.handle.folder / preview.file
        folder = context.data.frame(job, frame)
        taken = await context.calls.disk(adoption.adopt_preview, context.data, source, folder)
    except (adoption.NotAdopted, OSError):
        return None
    return preview.number if taken else None


def unusable() -> Json:
    """Return the problem for parts that cannot be merged."""
    return Problem("render-failed", "The checkpoints of the frame's parts could not be merged.").as_json()


GUESS_S = 0.5  # duration of a merge before one was measured
SHARE, SHARE_WATCHED = 0.02, 0.1  # share of one slot's time for merges
WATCHED_S = 15.0  # after a client asked for a preview
MOST_WAITING = 2  # parts per slot, which limits the films held at once


class MergePace:
    """Pace of a frame's merges. Times are of any monotonic clock."""

    def __init__(self, now: float, places: int) -> None:
        self._most_waiting = MOST_WAITING * places
        self._took_s = GUESS_S
        self._since = now  # end of the last merge
        self._watched_until = now

    def is_watched(self, now: float) -> None:
        """Record that a client watches."""
        self._watched_until = now + WATCHED_S

    def began(self, now: float) -> None:
        self._since = now

    def ended(self, now: float) -> None:
        self._took_s, self._since = now - self._since, now

    def is_due(self, waiting: int, now: float) -> bool:
        """Return whether a merge is due with that many parts ready for it."""
        share = SHARE_WATCHED if now < self._watched_until else SHARE
        return waiting > 0 and (waiting >= self._most_waiting or now - self._since >= self._took_s / share)
