"""ParallelFrame renders a claimed frame as parts, until the frame's row in the store says how it ended or is queued again.

Each part runs in an asyncio task of its own, and all of these end before the frame's task does. Merged samples are in the
frame's checkpoint, and its picture is made as that of any frame that resumes from a checkpoint: by a RunningFrame, which takes
no more samples.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace

from primray.settings import settings_as_json

from ...executor.base import end_tasks
from ...jobs import TERMINAL, Frame, FrameState, Job, JobState, Part, PartState, Scene
from ...queue.order import Key, Running
from ...store.base import Claim
from ..chunks import adoption, commands
from ..context import Context
from ..frames import job_progress
from ..frames.job_progress import SharedJob, SharedJobs
from ..frames.outcomes import Again, Broken, GivenUp, Outcome
from ..frames.run_completion import RunCompletion
from ..frames.running import DROPPED, RunningFrame, Taken
from .merge_run import Found, MergePace, MergeRun, adopt_merge, adopt_preview_of, remove_merged, unusable
from .part_run import PartEnd, PartRun, PartsProgress
from .plan import Plan, waits_again

LOOK_S = 0.5
NOT_LOST = ("enough", "cancel")  # parts that are no longer needed


class ParallelFrame:
    """A frame rendered in at most `places` slots at a time. `going`: it was told to end or to yield;
    `was_preempted`: a part of it had to yield."""

    def __init__(
        self, context: Context, jobs: SharedJobs, claim: Claim, on_free: Callable[[], Awaitable[None]], places: int
    ) -> None:
        self.job: Job = claim.job
        self.frame = claim.frame
        self.going = False
        self.was_preempted = False  # since another frame was given a slot
        self._places = places
        self._context = context
        self._jobs = jobs
        self._on_free = on_free
        self._loop = asyncio.get_running_loop()
        self._news = asyncio.Event()
        self._kill_for = ""
        self._failed: Outcome | None = None
        self._scene: Scene | None = None
        self._has_read = False
        self._holds_slot = True  # that of the claim, or for the picture: not a part's
        self._parts: dict[asyncio.Task[PartEnd], PartRun] = {}
        self._merging: tuple[asyncio.Task[Found | Outcome], MergeRun] | None = None
        self._picture: RunningFrame | None = None
        self._wants_preview = False
        self._has_freed = False  # a slot was freed since others were notified
        self._plan = Plan(self.job.settings.get("stop", {}), places)
        self._merges = MergePace(self._loop.time(), places)
        capacity = context.executor.capacity()
        asked = settings_as_json(commands.frame_settings(self.job.settings, self.frame, capacity))
        self._progress = PartsProgress(self._loop.time(), self.frame.convergence, asked)
        self._spent_s = commands.spent_s(self.frame)

    @property
    def key(self) -> tuple[str, int]:
        return self.job.id, self.frame.number

    @property
    def is_canceling(self) -> bool:
        return self.job.state is JobState.CANCELING

    @property
    def slots(self) -> int:
        if self._picture is not None:
            return self._picture.slots
        return self._used + self._holds_slot

    @property
    def _used(self) -> int:
        """Return the number of slots that its chunks hold."""
        return len(self._parts) + (self._merging is not None)

    @property
    def wants_slot(self) -> bool:
        if self._is_ending or not self._has_read or self._picture is not None or self._holds_slot:
            return False
        has_work = self._is_merge_due or self._plan.next_part(self.frame) is not None or self._is_sampled
        return self._used < self._places and has_work

    def take_slot(self) -> None:
        """Take a free slot for this frame."""
        self._holds_slot = True
        self._use_slot()
        self._news.set()

    def holders(self) -> list[Running]:
        """Return the holders of its slots, for preemption."""
        if self._picture is not None:
            return self._picture.holders()
        about = (self.job.priority, self.job.tenant)
        found = [
            Running((*self.key, run.part.first), *about, run.sampled_s, run.going or self.going) for run in self._parts.values()
        ]
        return found + [Running(self.key, *about, 0.0, going=True)] * (self._holds_slot + (self._merging is not None))

    def saw(self, job: Job | None) -> None:
        """Process the job's current row."""
        if job is None or job.attempt != self.job.attempt or job.state in TERMINAL:
            self.kill("gone")
            return
        self.job = job
        if self._picture is not None:
            self._picture.saw(job)
        elif job.state is JobState.PAUSING:
            self.shut_down()
        self._news.set()

    def preempt(self, key: Key | None = None) -> None:
        if self._picture is not None:
            self._picture.preempt()
        for run in self._parts.values():
            if (*self.key, run.part.first) == key:
                run.preempt()

    def shut_down(self) -> None:
        self.going = True
        if self._picture is not None:
            self._picture.shut_down()
        for run in self._parts.values():
            run.preempt()
        self._news.set()

    def ask_preview(self) -> None:
        """Request previews: merges leave them, and happen more often; the picture's worker writes another."""
        self._wants_preview = True
        self._merges.is_watched(self._loop.time())
        if self._picture is not None:
            self._picture.ask_preview()

    def kill(self, why: str) -> None:
        self._kill_for = self._kill_for or why
        if self._picture is not None:
            self._picture.kill(why)
        self._kill_parts(why)
        if self._merging is not None:
            self._merging[1].kill(why)
        self._news.set()

    def _kill_parts(self, why: str) -> None:
        for run in self._parts.values():
            run.kill(why)

    @property
    def _is_ending(self) -> bool:
        return self.going or bool(self._kill_for) or self.is_canceling or self._failed is not None

    async def live(self) -> None:
        """Run the frame; raises Lost if another dispatcher has it now."""
        reading = asyncio.create_task(self._jobs.get(self.job))
        try:
            await self._read()
            self.going = self.going or self.job.state is JobState.PAUSING
            shared = await reading
            outcome = await self._sample(shared)
            if self._kill_for not in DROPPED:
                await self._end_as(shared, outcome)
        finally:
            self._holds_slot = False
            reading.cancel()
            await self._end_tasks()

    async def _read(self) -> None:
        """Read the frame's parts, including those of a dead dispatcher; lost samples are rendered again."""
        context, calls, frame = self._context, self._context.calls, self.frame
        self._scene = await calls.store(context.store.scene, self.job.tenant, self.job.scene_id)
        parts = await calls.store(context.store.parts, self.job.id, frame.number)
        names = {part.checkpoint_file for part in parts} | {frame.checkpoint_file}
        gone = await calls.disk(adoption.missing, context.data, context.data.job(self.job.id), names - {""})
        if frame.merged and frame.checkpoint_file in gone:
            await calls.store(context.store.drop_parts, context.fence, frame)
            self.frame, parts = replace(frame, merged=0, checkpoint_file=""), []
        self._plan.begin(self.frame, [_as_left(part, gone) for part in parts])
        keep = {part.checkpoint_file for part in self._plan.ledger.parts} | {self.frame.checkpoint_file}
        await calls.disk(adoption.tidy_frame, context.data, self.job.id, frame.number, keep)
        self._progress.error = frame.progress.get("error") if self.frame.merged else None
        self._has_read = True

    async def _sample(self, shared: SharedJob) -> Taken | Outcome:
        """Render and merge parts until the frame is complete, or something else ends it."""
        while True:
            await self._reap()
            self._progress.hear(self._parts.values(), self._loop.time())
            self._follow_clock()
            if (end := self._end_now()) is not None:
                return end
            self._use_slot()
            if self._has_freed or self.wants_slot:
                self._has_freed = False
                await self._on_free()
            if not self._kill_for:
                await self._report(shared)
            with suppress(TimeoutError):
                await asyncio.wait_for(self._news.wait(), LOOK_S)
            self._news.clear()

    def _end_now(self) -> Taken | Outcome | None:
        """Return the frame's end, or None if it continues."""
        if self._kill_for:
            return Again(self.frame, self._kill_for)
        if self._failed is not None:
            return self._failed
        if self.going and not self.is_canceling:
            return None if self._parts else Again(self.frame, "shutdown")
        if self.is_canceling:
            self._kill_parts("cancel")
            return None if self._parts or self._merging is not None or self._plan.to_merge() else GivenUp()
        if not self._is_sampled:
            return None
        self._kill_parts("enough")
        if self._parts or not self._holds_slot:
            return None
        samples, out_of_time = self._plan.end
        return Taken(samples, self._plan.ledger.merged, out_of_time)

    @property
    def _is_sampled(self) -> bool:
        return self._plan.is_sampled(self.frame, runs=bool(self._parts), merges=self._merging is not None)

    def _follow_clock(self) -> None:
        self._plan.at(self._elapsed_s, self._context.limits.seconds)
        if self._plan.is_out_of_time:
            self._kill_parts("enough")

    @property
    def _elapsed_s(self) -> float:
        """Return the wall-clock seconds since the first sample, including earlier runs."""
        since = self._progress.inbox.sampling_since
        return self._spent_s + (0.0 if since is None else self._loop.time() - since)

    def _use_slot(self) -> None:
        """Take the frame's slot for a merge or a part; it is kept for the picture while nothing runs."""
        if self._is_merge_due and (self._holds_slot or self.is_canceling):
            self._merge()
            return
        if not self._holds_slot or self._is_ending or self._is_sampled:
            return
        part = self._plan.next_part(self.frame)
        if part is None or self._used >= self._places:
            self._holds_slot = not self._used
            return
        self._holds_slot = False
        run = PartRun(self._context, self.job, self.frame, part, self._scene, self._news.set)
        self._plan.ledger.put(replace(part, state=PartState.RUNNING))
        task = asyncio.create_task(run.live(), name="part")
        self._parts[task] = run
        task.add_done_callback(lambda _: self._news.set())

    async def _reap(self) -> None:
        """Process parts and merges that have ended."""
        for task in [task for task in self._parts if task.done()]:
            end, run = task.result(), self._parts.pop(task)
            self._has_freed = True
            self._progress.hear([run], self._loop.time())
            await self._take_part(end)
            self.was_preempted = self.was_preempted or run.going
            keeps = not run.going and (not self._used or self._is_merge_due)
            self._holds_slot = self._holds_slot or keeps
        if self._merging is not None and self._merging[0].done():
            task_of_merge, merge = self._merging
            try:
                await self._take_merge(merge, task_of_merge.result())
            finally:
                self._merging = None
                self._merges.ended(self._loop.time())
                self._has_freed = True
                await merge.close()
            self._holds_slot = self._holds_slot or not self._parts

    async def _take_part(self, end: PartEnd) -> None:
        is_cut = not self._plan.ledger.ends(end.part)
        if is_cut:
            await remove_merged(self._context, self.job.id, [end.part.checkpoint_file])
        if end.ended is not None:
            self._count(end.ended.cpu_s, end.ended.peak_rss_bytes)
        if end.outcome is None and not is_cut:
            self._plan.took(end.part.samples, end.sampled_s, end.load_s)
        elif isinstance(end.outcome, Broken):
            self._failed = end.outcome
        elif end.outcome is None:
            return
        elif not isinstance(end.outcome, Again) or end.outcome.why == "gone":
            self.kill("gone")
        elif end.outcome.why == "withdrawn":
            await self._withdraw(end.outcome)
        elif end.outcome.why not in NOT_LOST:
            self._context.metrics.restarts[f"part-{end.outcome.why}"] += 1

    def _count(self, cpu_s: float, peak_rss_bytes: int) -> None:
        frame = self.frame
        self.frame = replace(frame, cpu_s=frame.cpu_s + cpu_s, peak_rss_bytes=max(frame.peak_rss_bytes, peak_rss_bytes))

    @property
    def _is_merge_due(self) -> bool:
        """Return whether a merge comes before any part: something waits for it, or the pace asks for one."""
        if self._merging is not None or self.going or self._kill_for or self._failed is not None:
            return False
        waiting = len(self._plan.to_merge())
        if self.is_canceling:
            return waiting > 0 and not self._parts
        is_awaited = self._plan.is_merge_awaited(self.frame, runs=bool(self._parts))
        return is_awaited or self._merges.is_due(waiting, self._loop.time())

    def _merge(self) -> None:
        self._holds_slot = False
        merge = MergeRun(self._context, self.job, self.frame, self._plan.to_merge(), self._scene)
        task = asyncio.create_task(merge.live(), name="merge")
        task.add_done_callback(lambda _: self._news.set())
        self._merging = task, merge
        self._merges.began(self._loop.time())

    async def _take_merge(self, merge: MergeRun, found: Found | Outcome) -> None:
        if merge.ended is not None:
            self._count(merge.ended.cpu_s, merge.ended.peak_rss_bytes)
        if isinstance(found, Again):
            self._context.metrics.restarts[f"merge-{found.why}"] += 1
            self.frame = replace(self.frame, crashes=found.frame.crashes, kills=found.frame.kills)
            if found.drop_checkpoint:
                await self._begin_anew(found)
        elif not isinstance(found, Found):
            self._failed = found
        elif not self._kill_for:
            await self._adopt(merge, found)

    async def _begin_anew(self, why: Again) -> None:
        """Start again without the parts, or the merged samples, which are unusable: another build made them, or they are
        damaged."""
        context = self._context
        crashes = self.frame.crashes + 1
        if crashes >= context.limits.crashes:
            self._failed = Broken(unusable())
            return
        await context.calls.store(context.store.drop_parts, context.fence, self.frame)
        self.frame = replace(self.frame, crashes=crashes, merged=0, checkpoint_file="")
        self._failed = Again(self.frame, why.why)

    async def _withdraw(self, why: Again) -> None:
        """Start again without all parts, of which some came from a machine that is excluded: sums cannot be taken apart.

        Each time, the cluster has one machine less, so that this ends.
        """
        if self._failed is None:
            await self._context.calls.store(self._context.store.drop_parts, self._context.fence, self.frame)
            self.frame = replace(self.frame, merged=0, checkpoint_file="")
            self._failed = Again(self.frame, why.why)

    async def _adopt(self, merge: MergeRun, found: Found) -> None:
        before = self.frame
        taken = await adopt_merge(self._context, self.job, before, merge, found)
        if taken is None:
            self.kill("gone")
        elif not isinstance(taken, Frame):
            self._failed = taken
        else:
            gone = [part.checkpoint_file for part in self._note(merge, found)] + [before.checkpoint_file]
            self.frame = replace(taken, progress=before.progress | {"spent_s": self._elapsed_s})
            for run in self._parts.values():
                if self._plan.ledger.is_cut(run.part):
                    run.kill("enough")
            await remove_merged(self._context, self.job.id, gone)
            await self._take_preview(merge)

    def _note(self, merge: MergeRun, found: Found) -> list[Part]:
        """Record a merge and return the parts that are merged or shortened by it."""
        assert merge.run is not None
        self._progress.error = found.error
        self._progress.merged(found.rays, merge.end)
        self._progress.inbox.convergence = merge.run.inbox.convergence
        self._progress.inbox.has_news = True
        return self._plan.merged(merge.end, found.judged)

    async def _take_preview(self, merge: MergeRun) -> None:
        number = await adopt_preview_of(self._context, self.job.id, self.frame.number, merge)
        if number is not None:
            shared = await self._jobs.get(self.job)
            await job_progress.tell_preview(self._context, shared, self.frame, number)

    async def _report(self, shared: SharedJob) -> None:
        running = list(self._parts.values())
        self._progress.progress(self._plan, running, self._elapsed_s)
        if job_progress.wait_s(self._progress, shared, self._loop.time()) == 0.0:
            job, self.frame = await job_progress.report(self._context, shared, self.job, self.frame, self._progress)
            self.saw(job)

    async def _end_as(self, shared: SharedJob, end: Taken | Outcome) -> None:
        if isinstance(end, Taken):
            await self._make_picture(end)
            return
        if isinstance(end, GivenUp) and self.frame.merged:
            await self._make_picture(None)  # of a canceled frame that had samples
            return
        self.frame = job_progress.updated(self.frame, self._progress)
        completion = RunCompletion(context=self._context, shared=shared, job=self.job, frame=self.frame, run=None, ended=None)
        await self._end_tasks()
        self._holds_slot = False
        await self._on_free()
        if isinstance(end, Broken):
            await completion.without(FrameState.FAILED, end.problem)
        elif isinstance(end, GivenUp):
            await completion.without(FrameState.CANCELED, None)
        elif isinstance(end, Again):
            await completion.again(end if end.frame is self.frame else replace(end, frame=self.frame))
        if completion.is_over:
            self._jobs.forget(self.job)

    async def _make_picture(self, taken: Taken | None) -> None:
        self.frame = job_progress.updated(self.frame, self._progress)
        claim = Claim(self.job, self.frame)
        self._picture = RunningFrame(self._context, self._jobs, claim, self._on_free, taken)
        self._holds_slot = False
        if self._wants_preview:
            self._picture.ask_preview()
        await self._picture.live()

    async def _end_tasks(self) -> None:
        """End all tasks of the frame."""
        tasks: list[asyncio.Task[PartEnd] | asyncio.Task[Found | Outcome]] = list(self._parts)
        if self._merging is not None:
            tasks.append(self._merging[0])
        await end_tasks(tasks)
        if self._merging is not None:
            await self._merging[1].close()
        self._merging = None
        self._parts.clear()


def _as_left(part: Part, gone: set[str]) -> Part:
    """Return a part as a dead dispatcher left it: it does not run, and its samples may be lost."""
    if part.checkpoint_file in gone:
        return replace(waits_again(part), checkpoint_file="")
    return part if part.state is PartState.DONE else waits_again(part)
