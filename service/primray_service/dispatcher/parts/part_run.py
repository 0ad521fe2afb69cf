"""One part of a frame, from being handed to a chunk until its row says that it is done, or queued again; and the frame's
progress from all of its parts, in the form of a frame that one worker renders."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from primray.settings import SAMPLE_BLOCK

from ... import ids
from ...executor.base import Ended
from ...jobs import Frame, Job, Json, Part, PartState, Scene
from ...problems import Problem
from ..chunks import adoption, commands
from ..chunks.chunk_run import ChunkRun, adopt_checkpoint_of
from ..chunks.commands import stage_inputs
from ..chunks.messages import Checkpoint, Inbox
from ..context import Context
from ..frames import outcomes, run_completion
from ..frames.outcomes import Again, Broken, Circumstances, GivenUp, Outcome, Picture, outcome_of
from .plan import Plan, waits_again

SILENT_S = 900.0
YIELD_S = 60.0
LOOK_S = 5.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.25, 5.0


@dataclass(frozen=True)
class PartEnd:
    """End of a part's run: `part` matches its row; `outcome` is None if it is done."""

    part: Part
    outcome: Outcome | None
    ended: Ended | None = None
    load_s: float = 0.0  # seconds before sampling, and of sampling
    sampled_s: float = 0.0


class PartRun:
    """Running part; `on_news` is called when a message came. Belongs to the event loop."""

    def __init__(
        self, context: Context, job: Job, frame: Frame, part: Part, scene: Scene | None, on_news: Callable[[], None]
    ) -> None:
        self.part = part
        self.going = False
        self._context = context
        self._job = job
        self._frame = frame
        self._scene = scene
        self._on_news = on_news
        self._run: ChunkRun | None = None
        self._kill_for = ""
        self._claim = ""
        self._sampled_s = 0.0  # in total
        self._began = asyncio.get_running_loop().time()

    @property
    def inbox(self) -> Inbox | None:
        return None if self._run is None else self._run.inbox

    @property
    def sampled_s(self) -> float:
        return 0.0 if self._run is None else self._run.sampled_s

    def preempt(self) -> None:
        if not self.going:
            self.going = True
            if self._run is not None:
                self._run.tell_to_end("yield", YIELD_S, "yield")

    def kill(self, why: str) -> None:
        self._kill_for = self._kill_for or why
        if self._run is not None:
            self._run.kill(why)

    async def live(self) -> PartEnd:
        """Run the part; raises Lost if another dispatcher has the frame now."""
        context = self._context
        chunk_id = self._claim = f"c{ids.ulid(time.time())}"
        part = replace(self.part, state=PartState.RUNNING, claim=chunk_id)
        if not await context.calls.store(context.store.give_out_part, context.fence, self._frame, part):
            return PartEnd(self.part, Again(self._frame, "gone"))
        self.part = part
        try:
            begun = await self._begin(chunk_id)
            if not isinstance(begun, ChunkRun):
                return await self._settle(begun, None)
            await self._follow(begun)
            ended = await begun.ended()
            await self._take_checkpoints(begun)
            context.metrics.worker_cpu_s += ended.cpu_s
            return await self._settle(await self._outcome(begun, ended), ended)
        finally:
            run, self._run = self._run, None
            if run is not None:
                await run.close()

    async def _begin(self, chunk_id: str) -> ChunkRun | Outcome:
        context, part = self._context, self.part
        try:
            if self._scene is None:
                raise Problem("internal", "The scene is not on the server any more; upload it again.")
            await stage_inputs(context, self._scene, part.job_id, (part.checkpoint_file,))
            capacity = context.executor.capacity()
            about = (self._job, self._frame, self.part, self._scene)
            chunk = commands.part_chunk(chunk_id, *about, context.data, capacity, context.limits)
            if self._kill_for or self.going:
                return Again(self._counted, self._kill_for or "yield")
            self._run = ChunkRun(context.executor, chunk, [])
        except (Problem, ValueError, OSError) as error:
            return run_completion.not_begun(self._counted, error, context.limits)
        return self._run

    @property
    def _counted(self) -> Frame:
        """Return the frame with the part's deaths as its own, since the outcome of a part is decided like a frame's."""
        return replace(self._frame, crashes=self.part.crashes, kills=self.part.kills)

    async def _follow(self, run: ChunkRun) -> None:
        while not run.is_over:
            await run.news(LOOK_S)
            self._on_news()
            await self._take_checkpoints(run)
            if run.silent_s > SILENT_S:
                run.kill("silent")
        self._sampled_s = run.sampled_s

    async def _take_checkpoints(self, run: ChunkRun) -> None:
        while run.inbox.checkpoints and not self._kill_for:
            await self._take_checkpoint(run, run.inbox.checkpoints.popleft())

    async def _take_checkpoint(self, run: ChunkRun, message: Checkpoint) -> None:
        """Adopt a checkpoint: the file is on the disk before the row names it; the previous one is removed last."""
        context, part = self._context, self.part
        if message.number != part.checkpoint + 1:
            run.distrust()
            return
        name = adoption.part_file(part.first, message.number, part.frame, run.chunk.id)
        folder = context.data.job(part.job_id)
        if not await adopt_checkpoint_of(run, message, folder / name, context):
            return
        taken = replace(part, checkpoint=message.number, checkpoint_file=name, crashes=0, kills=0)
        if not await context.calls.store(context.store.accept_part, context.fence, self._frame, taken):
            await context.calls.disk(context.data.remove, folder / name)
            self.kill("gone")
            return
        context.metrics.checkpoints += 1
        self.part = taken
        if part.checkpoint_file:
            await context.calls.disk(context.data.remove, folder / part.checkpoint_file)

    async def _outcome(self, run: ChunkRun, ended: Ended) -> Outcome:
        context, last = self._context, run.inbox.last
        disk_is_full = run.killed_for == "storage" or await context.look_at_disk()
        about = Circumstances(False, run.killed_for, disk_is_full, run.chunk.command["checkpoint"] is not None)
        outcome = outcome_of(self._counted, last, ended, about, context.limits_of_chunks)
        if isinstance(outcome, Picture):
            if self._kill_for:  # too late: what it left was not adopted
                return Again(self._counted, self._kill_for)
            stop = outcome.done.report.get("stop")
            if not isinstance(stop, dict) or stop.get("reason") != "samples":
                return Again(self._counted, "yield")
            if not self.part.checkpoint_file or outcome.done.outputs:
                return Broken(Problem("render-failed", "The render process sent an invalid message.").as_json())
        return outcome

    async def _settle(self, outcome: Outcome, ended: Ended | None) -> PartEnd:
        """Write the outcome to the part's row; the rows of a deleted frame are gone."""
        context, run = self._context, self._run
        load_s = 0.0
        if run is not None and run.inbox.sampling_since is not None:
            load_s = run.inbox.sampling_since - self._began
        await self._log(outcome, ended)
        if isinstance(outcome, Picture):
            self.part = replace(self.part, state=PartState.DONE)
        else:
            self.part = waits_again(self.part)
            if isinstance(outcome, Again):
                frame = outcome.frame
                self.part = replace(self.part, crashes=frame.crashes, kills=frame.kills)
                if outcome.drop_checkpoint:
                    self.part = replace(self.part, checkpoint_file="")
                if frame.kills > 1:
                    await asyncio.sleep(min(FIRST_PAUSE_S * 2.0 ** (frame.kills - 2), LONGEST_PAUSE_S))
        claimed = replace(self.part, claim=self._claim)
        accepted = await context.calls.store(context.store.accept_part, context.fence, self._frame, claimed)
        if isinstance(outcome, Picture) and accepted:
            return PartEnd(self.part, None, ended, load_s, self._sampled_s)
        return PartEnd(self.part, GivenUp() if isinstance(outcome, Picture) else outcome, ended)

    async def _log(self, outcome: Outcome, ended: Ended | None) -> None:
        if ended is None or self._run is None:
            return
        path = self._context.data.frame(self.part.job_id, self.part.frame) / adoption.LOG
        signal = "" if ended.signal is None else f" {outcomes.signal_name(ended.signal)}"
        became = "done" if isinstance(outcome, Picture) else "failed"
        if isinstance(outcome, Again):
            became = f"queued again: {outcome.why}"
        title = f"samples {self.part.first}:{self.part.end}, chunk {self._run.chunk.id}: {ended.reason}{signal}; {became}"
        text = ended.log if ended.log_file is None else ended.log_file
        try:
            limits, data = self._context.limits, self._context.data
            await self._context.calls.disk(adoption.append_log, data, path, title, text, limits.log_bytes)
        except OSError:
            self._context.disk_is_full = True


# Settings in which a part differs from its frame.
OF_FRAME = ("spp", "target_error", "time_limit_s", "sample_range", "stop_at")


class PartsProgress:
    """Combined messages of all parts: the frame's news."""

    def __init__(self, now: float, convergence: list[Json], asked: Json) -> None:
        self.inbox = Inbox(now, convergence)
        self._asked = asked  # the frame's settings
        self._rays: dict[int, int] = {}  # of done and of running parts
        self._merged_rays = 0
        self.error: Json | None = None  # of the merged samples, as in progress documents

    def hear(self, runs: Iterable[PartRun], now: float) -> None:
        """Take over the messages of the parts."""
        for run in runs:
            heard = run.inbox
            if heard is None or not heard.has_news:
                continue
            heard.has_news = False
            self._take(heard, run.part.first, now)

    def _take(self, heard: Inbox, first: int, now: float) -> None:
        inbox = self.inbox
        inbox.has_news = True
        if heard.effective is not None and inbox.effective is None:
            settings = heard.effective.get("settings", {})
            frame = {name: self._asked.get(name) for name in OF_FRAME} | {"adaptive": False}
            inbox.effective = heard.effective | {"settings": settings | frame}
        inbox.warnings += heard.warnings
        heard.warnings = []
        if heard.sampling_since is not None and inbox.sampling_since is None:
            inbox.sampling_since = now
            inbox.is_urgent = True
        if inbox.phase != "sampling":
            inbox.phase = heard.phase or inbox.phase
        if heard.progress is not None:
            self._rays[first] = int(heard.progress.get("rays") or 0)

    def merged(self, rays: int, end: int) -> None:
        self._merged_rays = rays
        self._rays = {first: n for first, n in self._rays.items() if first >= end}

    def progress(self, plan: Plan, running: list[PartRun], elapsed_s: float) -> None:
        """Update the progress for the frame's row and for clients."""
        ledger, rules, sample_s = plan.ledger, plan.rules, plan.costs.sample_s
        now = [run.inbox.progress for run in running if run.inbox is not None and run.inbox.progress is not None]
        taken = ledger.taken() + sum(float(said.get("samples_done") or 0.0) for said in now)
        end = plan.expected_end
        parts = [taken / end] if end else []
        if rules.seconds:
            parts.append(elapsed_s / rules.seconds)
        left = None
        if end is not None and rules.seconds is None and sample_s is not None and running:
            left = max(end - taken, 0.0) * sample_s / len(running)
        self.inbox.progress = {
            "fraction": min(max(parts, default=0.0), 0.99),
            "samples_done": taken,
            "samples_min": ledger.merged,
            "samples_max": ledger.given,
            "rays": self._merged_rays + sum(self._rays.values()),
            "rays_per_s": sum(float(said.get("rays_per_s") or 0.0) for said in now),
            "elapsed_s": elapsed_s,
            "pass": ledger.merged // SAMPLE_BLOCK,
            "error": self.error,
            "eta_s": left,
            "eta_ci95": None,
        }
