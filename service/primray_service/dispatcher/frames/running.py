"""A claimed frame, until its row says how it ended or that it is queued again.

It runs in one task of the event loop. Calls from others (`saw`, `preempt`, `kill`) are passed on to the worker, or end it; the
task then determines why its chunk ended, and outcomes.py decides.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace

from ... import ids
from ...executor.base import Ended
from ...jobs import TERMINAL, Frame, FrameState, Job, JobState
from ...problems import Problem
from ...queue.estimates import MOST_RATES
from ...queue.order import Key, Running
from ...store.base import Claim
from ..chunks import adoption, commands
from ..chunks.chunk_run import ChunkRun, adopt_checkpoint_of
from ..chunks.commands import stage_inputs
from ..chunks.messages import Checkpoint
from ..context import Context
from . import job_progress, run_completion
from .job_progress import SharedJob, SharedJobs
from .outcomes import Again, Broken, Circumstances, GivenUp, Outcome, Picture, outcome_of

SILENT_S = 900.0  # a worker silent for this long is considered hung
PICTURE_S = 20.0  # to make a canceled frame's picture from its checkpoint
YIELD_S = 60.0  # a preempted frame is killed after this long; it yields between two parts of a pass
LOOK_S = 5.0

# A chunk killed for one of these leaves no trace: the row is another's, or already has the frame's outcome.
DROPPED = frozenset({"lost", "expired", "gone"})


@dataclass(frozen=True)
class Taken:
    """Samples of a frame in parts that is complete or out of time, whose picture is to be made. The picture takes `samples` per
    pixel: at most `merged`, those in the frame's merged checkpoint, or one more where that is odd."""

    samples: int
    merged: int
    out_of_time: bool = False


class RunningFrame:
    """A claimed frame; `has_slot`: its chunk runs or is about to; `going`: it is to end, or to yield."""

    def __init__(
        self,
        context: Context,
        jobs: SharedJobs,
        claim: Claim,
        on_free: Callable[[], Awaitable[None]],
        taken: Taken | None = None,
    ) -> None:
        self.job: Job = claim.job
        self.frame: Frame = claim.frame
        self.has_slot = True
        self.going = False
        self._context = context
        self._jobs = jobs
        self._on_free = on_free  # gives its slot to another frame
        self._run: ChunkRun | None = None
        self._kill_for = ""  # before the run exists, or after it
        self._taken = taken  # set for the picture of a frame in parts
        self._out_of_time = taken is not None and taken.out_of_time
        self._wants_preview = False  # requested before the run exists
        self._claimed_at = asyncio.get_running_loop().time()

    @property
    def key(self) -> tuple[str, int]:
        return self.job.id, self.frame.number

    @property
    def slots(self) -> int:
        return int(self.has_slot)

    def holders(self) -> list[Running]:
        """Return the holders of its slots, for preemption."""
        here = Running(self.key, self.job.priority, self.job.tenant, self.sampled_s, self.going)
        return [here] if self.has_slot else []

    @property
    def sampled_s(self) -> float:
        return self._run.sampled_s if self._run is not None else 0.0

    @property
    def is_canceling(self) -> bool:
        return self.job.state is JobState.CANCELING

    @property
    def is_pausing(self) -> bool:
        return self.job.state is JobState.PAUSING

    def saw(self, job: Job | None) -> None:
        """Process the job's current row."""
        if job is None or job.attempt != self.job.attempt or job.state in TERMINAL:
            self.kill("gone")
            return
        was_canceling, was_pausing, self.job = self.is_canceling, self.is_pausing, job
        if self.is_canceling and not was_canceling:
            self.going = True
            if self._run is not None:
                self._stop_for_cancel(self._run)
        elif self.is_pausing and not was_pausing:
            if self._run is not None:
                self._yield_for_pause(self._run)
            self.going = True

    def _yield_for_pause(self, run: ChunkRun) -> None:
        """Yield for a pause, with a checkpoint of the samples taken so far; if there are none yet, end at once, which loses
        nothing."""
        if run.inbox.sampling_since is None:
            run.kill("pause")
        elif not self.going:
            run.tell_to_end("yield", YIELD_S, "yield")

    def _stop_for_cancel(self, run: ChunkRun) -> None:
        """Stop for a cancellation, with a picture if possible: of the samples taken so far, or of the checkpoint that is being
        read."""
        if run.inbox.sampling_since is not None:
            run.tell_to_end("stop", self._context.limits.stop_grace_s, "cancel")
        elif self.frame.checkpoint_file:
            run.tell_to_end("stop", PICTURE_S, "cancel")
        else:
            run.kill("cancel")

    def preempt(self, key: Key | None = None) -> None:
        """Yield to another frame; `key` names the holder, of which a whole frame has one."""
        if not self.going:
            self.going = True
            if self._run is not None:
                self._run.tell_to_end("yield", YIELD_S, "yield")

    def shut_down(self) -> None:
        self.going = True
        if self._run is not None and not self.is_canceling:
            self._run.tell("yield")

    def ask_preview(self) -> None:
        self._wants_preview = True
        if self._run is not None:
            self._run.ask_preview()

    def kill(self, why: str) -> None:
        self._kill_for = self._kill_for or why
        if self._run is not None:
            self._run.kill(why)

    async def live(self) -> None:
        """Run the frame; raises Lost if another dispatcher has it now."""
        reading = asyncio.create_task(self._jobs.get(self.job))
        try:
            await self._live(reading)
        finally:
            self.has_slot = False
            reading.cancel()

    async def _live(self, reading: asyncio.Task[SharedJob]) -> None:
        ended, outcome = await self._render(reading, picture_only=False)
        if isinstance(outcome, GivenUp) and self.frame.checkpoint_file and not self._kill_for:
            await self._close()
            ended, outcome = await self._render(reading, picture_only=True)
        # The process is gone, so another frame can start: while this one's outputs are adopted, and before a preempted frame is
        # queued again, or it would be first in the queue.
        self.has_slot = False
        noted = None
        if isinstance(outcome, Picture) and not self.is_canceling and self._taken is None:  # otherwise other slots had a part
            noted = self._context.rates.note(self.job, asyncio.get_running_loop().time() - self._claimed_at)
        await self._on_free()
        shared = await reading
        try:
            if self._kill_for not in DROPPED:
                await self._settle(shared, ended, outcome)
        finally:
            await self._close()
        if noted is not None:
            await self._context.calls.store(self._context.store.note_work, self._context.fence, *noted, time.time(), MOST_RATES)

    async def _render(self, reading: asyncio.Task[SharedJob], *, picture_only: bool) -> tuple[Ended | None, Outcome]:
        """Run a chunk of the frame to its end and return the frame's outcome; `Ended` is None if there was no chunk."""
        run = await self._start(picture_only)
        if not isinstance(run, ChunkRun):
            return None, run
        try:
            if picture_only:
                run.kill_in(PICTURE_S, "cancel")
            elif self.is_canceling:
                self._stop_for_cancel(run)
            elif self.is_pausing:
                self._yield_for_pause(run)
            shared = await self._follow(run, reading)
            ended = await run.ended()
            await self._take_checkpoints(run)
            if (run.inbox.is_urgent or run.inbox.warnings) and self._kill_for not in DROPPED:
                self.job, self.frame = await job_progress.report(self._context, shared, self.job, self.frame, run)
            self.frame = job_progress.updated(self.frame, run)
        except BaseException:
            await self._close()
            raise
        self._context.metrics.worker_cpu_s += ended.cpu_s
        spent = replace(self.frame, cpu_s=self.frame.cpu_s + ended.cpu_s)
        self.frame = replace(spent, peak_rss_bytes=max(spent.peak_rss_bytes, ended.peak_rss_bytes))
        disk_is_full = run.killed_for == "storage" or await self._context.look_at_disk()
        about = Circumstances(self.is_canceling, run.killed_for, disk_is_full, run.chunk.command["checkpoint"] is not None)
        return ended, outcome_of(self.frame, run.inbox.last, ended, about, self._context.limits_of_chunks)

    async def _start(self, picture_only: bool) -> ChunkRun | Outcome:
        context, job, frame = self._context, self.job, self.frame
        tidied = context.calls.disk(adoption.tidy_frame, context.data, job.id, frame.number, (frame.checkpoint_file,))
        read = context.calls.store(context.store.scene, job.tenant, job.scene_id)
        counted = context.calls.store(context.store.frame_counts, job.id)
        scene, counts, _ = await asyncio.gather(read, counted, tidied)
        more = counts[FrameState.QUEUED.value] > 0
        asked = commands.Asked(
            sum(counts.values()), more, picture_only, self._wants_preview, None if self._taken is None else self._taken.samples
        )
        try:
            if scene is None:
                raise Problem("internal", "The scene is not on the server any more; upload it again.")
            await stage_inputs(context, scene, job.id, (frame.checkpoint_file,))
            chunk_id = f"c{ids.ulid(time.time())}"
            capacity = context.executor.capacity()
            chunk = commands.render_chunk(chunk_id, job, frame, scene, context.data, capacity, context.limits, asked)
            if self._kill_for or (self.is_canceling and not picture_only):
                return GivenUp() if self.is_canceling else Again(frame, self._kill_for)
            if self.is_pausing:
                return Again(frame, "pause")
            self._run = ChunkRun(context.executor, chunk, frame.convergence)
        except (Problem, ValueError, OSError) as error:
            return run_completion.not_begun(frame, error, context.limits)
        if self.going and not self.is_canceling:  # it was to yield before the run existed
            self._run.tell_to_end("yield", YIELD_S, "yield")
        return self._run

    async def _follow(self, run: ChunkRun, reading: asyncio.Task[SharedJob]) -> SharedJob:
        """Process messages until there are no more."""
        loop, context = asyncio.get_running_loop(), self._context
        shared: SharedJob | None = None
        first_sample = True
        while not run.is_over:
            if shared is None and reading.done():
                shared = reading.result()
            wait_s = job_progress.wait_s(run, shared, loop.time()) if shared is not None else 0.05
            if wait_s != 0.0:
                await run.news(LOOK_S if wait_s is None else min(wait_s, LOOK_S))
            if first_sample and run.inbox.sampling_since is not None:
                first_sample = False
                context.metrics.first_sample.observe(run.inbox.sampling_since - self._claimed_at)
            await self._take_checkpoints(run)
            if shared is None:
                continue
            await self._take_preview(run, shared)
            if not run.is_over and job_progress.wait_s(run, shared, loop.time()) == 0.0:
                job, self.frame = await job_progress.report(context, shared, self.job, self.frame, run)
                self.saw(job)
            self._watch(run)
        shared = shared or await reading
        await self._take_preview(run, shared)  # a short frame's only preview may come with its last messages
        return shared

    def _watch(self, run: ChunkRun) -> None:
        limits = self._context.limits
        if run.silent_s > SILENT_S:
            run.kill("silent")
        elif not self.going and float(run.chunk.command["spent_s"]) + run.sampled_s > limits.seconds:
            self.going = self._out_of_time = True
            run.tell_to_end("stop", max(limits.stop_grace_s, YIELD_S), "silent")

    async def _take_checkpoints(self, run: ChunkRun) -> None:
        while run.inbox.checkpoints and self._kill_for not in DROPPED:
            await self._take_checkpoint(run, run.inbox.checkpoints.popleft())

    async def _take_checkpoint(self, run: ChunkRun, message: Checkpoint) -> None:
        """Adopt a checkpoint: the file is on the disk before the row names it, and the previous one is removed last, so the
        row's file exists at any time."""
        context, frame = self._context, self.frame
        began = time.monotonic()
        if message.number != frame.checkpoint + 1:
            run.distrust()
            return
        name = adoption.checkpoint_file(message.number, frame.number, run.chunk.id)
        folder = context.data.job(self.job.id)
        if not await adopt_checkpoint_of(run, message, folder / name, context):
            return
        accepted = await context.calls.store(
            context.store.accept_checkpoint,
            context.fence,
            f"{run.chunk.id}-{message.number}",
            self.job.id,
            frame.number,
            attempt=frame.attempt,
            follows=frame.checkpoint,
            file=name,
            now=time.time(),
            merged=self._merged,
        )
        if not accepted:
            await context.calls.disk(context.data.remove, folder / name)
            self.kill("gone")
            return
        context.metrics.checkpoints += 1
        context.metrics.adopt_checkpoint.observe(time.monotonic() - began)
        older = frame.checkpoint_file
        # Time that a limit counts, by the wall clock: close enough, and known for every kind of worker.
        progress = frame.progress | {"spent_s": float(run.chunk.command["spent_s"]) + run.sampled_s}
        taken = replace(frame, checkpoint=message.number, checkpoint_file=name, merged=self._merged, crashes=0, kills=0)
        self.frame = replace(taken, progress=progress)
        if older and older != name:
            await context.calls.disk(context.data.remove, folder / older)

    @property
    def _merged(self) -> int:
        """Return the samples merged in its checkpoint, from which parts could continue; 0 if it is no such checkpoint."""
        return self._taken.merged if self._taken is not None and self._taken.merged == self._taken.samples else 0

    async def _take_preview(self, run: ChunkRun, shared: SharedJob) -> None:
        preview, run.inbox.preview = run.inbox.preview, None
        if preview is None:
            return
        context = self._context
        folder = context.data.frame(self.job.id, self.frame.number)
        try:
            taken = await context.calls.disk(adoption.adopt_preview, context.data, run.handle.folder / preview.file, folder)
        except adoption.NotAdopted:
            run.distrust()
            return
        except OSError:
            return  # the disk is full; pictures do not depend on previews
        if taken:
            await job_progress.tell_preview(context, shared, self.frame, preview.number)

    async def _settle(self, shared: SharedJob, ended: Ended | None, outcome: Outcome) -> None:
        run, context = self._run, self._context
        completion = run_completion.RunCompletion(context, shared, self.job, self.frame, run, ended)
        left: Outcome | None = outcome
        if isinstance(outcome, Picture):
            left = await completion.with_picture(outcome.done, out_of_time=self._out_of_time)
        if isinstance(left, Broken):
            await completion.without(FrameState.FAILED, left.problem)
        elif isinstance(left, GivenUp):
            await completion.without(FrameState.CANCELED, None)
        elif isinstance(left, Again):
            await completion.again(left)
        if completion.is_over:
            self._jobs.forget(self.job)

    async def _close(self) -> None:
        run, self._run = self._run, None
        if run is not None:
            await run.close()
