"""Storage of how a frame's run ended: its outputs and its row, in an order in which a crash at any point leaves a state that
the next dispatcher completes in the same way."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass, replace

from ...executor.base import Ended
from ...jobs import TERMINAL, Frame, FrameState, Job, JobState, Json, Output
from ...limits import Limits
from ...problems import Problem
from ..chunks import adoption
from ..chunks.chunk_run import ChunkRun
from ..chunks.messages import Done
from ..context import Context
from ..lease import TTL_S
from . import outcomes
from .job_progress import SharedJob
from .outcomes import Again, Broken, GivenUp, Outcome
from .totals import frame_result, target_warning

FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.25, 5.0  # before a retry of a frame whose worker was killed repeatedly


def not_begun(frame: Frame, error: Exception, limits: Limits) -> Outcome:
    """Return the outcome of a frame whose chunk could not be made or submitted."""
    if isinstance(error, Problem) and error.slug != "unavailable":
        return Broken(error.as_json())
    if isinstance(error, ValueError):
        return Broken(Problem("settings-rejected", f"These settings cannot be rendered: {error}.").as_json())
    frame = replace(frame, kills=frame.kills + 1)
    if frame.kills < limits.kills:
        return Again(frame, "unavailable")
    return Broken(Problem("unavailable", "The server could not start a render process.").as_json())


@dataclass
class RunCompletion:
    """Completion of one run; `is_over` tells whether the job has ended too."""

    context: Context
    shared: SharedJob
    job: Job
    frame: Frame
    run: ChunkRun | None
    ended: Ended | None
    is_over: bool = False

    async def with_picture(self, done: Done, *, out_of_time: bool) -> Outcome | None:
        """Adopt the outputs and end the frame; return another outcome if that is impossible."""
        began = time.monotonic()
        canceling = self.job.state is JobState.CANCELING
        if not done.outputs:
            return GivenUp() if canceling else Broken(Problem("render-failed", "The render made no picture.").as_json())
        stop = _stop_of(done, out_of_time)
        if stop is None:
            return Broken(Problem("render-failed", "The render process did not report why it ended.").as_json())
        earlier = await self._earlier_outputs()
        try:
            outputs = await self._adopt(done)
        except adoption.NotAdopted as error:
            return Broken(Problem("render-failed", f"The outputs do not match the render process's report: {error}.").as_json())
        except OSError:
            self.context.disk_is_full = True
            return Again(self.frame, "storage")
        names = [output.name for output in outputs]
        kept = {self.context.data.output(self.job.id, output.name, output.sha256) for output in outputs}
        result = frame_result(done.report, stop, self.job, names)
        warning = target_warning(self.frame, result, len(self.shared.totals))
        state = FrameState.CANCELED if canceling else FrameState.SUCCEEDED
        await self._end(state, outputs=outputs, result=result, warnings=[] if warning is None or canceling else [warning])
        for row in earlier:
            if self.context.data.output(self.job.id, row.name, row.sha256) not in kept:
                await self.context.calls.disk(
                    self.context.data.remove, self.context.data.output(self.job.id, row.name, row.sha256)
                )
        self.context.metrics.end_frame.observe(time.monotonic() - began)
        return None

    async def without(self, state: FrameState, problem: Json | None) -> None:
        """End the frame without a picture."""
        await self._end(state, error=None if problem is None else {**problem, "attempt": self.frame.attempt})

    async def again(self, outcome: Again) -> None:
        context, frame = self.context, outcome.frame
        await self._log(f"queued again: {outcome.why}")
        if frame.kills > 1:
            await asyncio.sleep(min(FIRST_PAUSE_S * 2.0 ** (frame.kills - 2), LONGEST_PAUSE_S))
        if outcome.drop_checkpoint and frame.checkpoint_file:
            await context.calls.disk(context.data.remove, context.data.job(self.job.id) / frame.checkpoint_file)
        async with self.shared.lock:
            context.metrics.restarts[outcome.why] += 1
            waiting = replace(frame, state=FrameState.QUEUED, phase="")
            self.shared.totals.set(waiting)
            job = await context.calls.store(context.store.requeue_frame, context.fence, frame, time.time())
        self.is_over = job.state in TERMINAL

    async def _earlier_outputs(self) -> list[Output]:
        """Return the outputs of earlier attempts: their rows are deleted when the frame ends, their files after that."""
        if self.frame.attempt == 1:
            return []
        rows = await self.context.calls.store(self.context.store.outputs, self.job.id)
        return [row for row in rows if row.frame == self.frame.number]

    async def _adopt(self, done: Done) -> list[Output]:
        context, job, frame = self.context, self.job, self.frame
        assert self.run is not None
        assert self.ended is not None
        if not all(_is_asked(made.name, self.run.chunk.command) for made in done.outputs):
            raise adoption.NotAdopted("one of them was not requested")
        adopted = await context.calls.disk(
            adoption.adopt_outputs,
            done.outputs,
            self.ended,
            context.data.frame(job.id, frame.number),
            context.limits.output_bytes,
            self.run.chunk.id,
        )
        outputs, now = [], time.time()
        folder = context.data.outputs(job.id)
        for made, kept in adopted:
            target = context.data.output(job.id, made.name, made.sha256)
            if not await context.calls.disk(adoption.publish_new, context.data, kept, target):
                # A dead server left the file before it wrote its row; or a server that holds the lease now was here.
                now = await context.calls.store(context.store.clock)
                await context.calls.store(context.store.renew_lease, context.fence, now, TTL_S)
                await context.calls.disk(adoption.publish_over, kept, target)
            outputs.append(
                Output(
                    job_id=job.id,
                    name=made.name,
                    frame=frame.number,
                    bytes=made.bytes,
                    sha256=made.sha256,
                    media_type=made.media_type,
                    created_at=now,
                )
            )
        await context.calls.disk(adoption.published, context.data, folder)
        return outputs

    async def _end(
        self,
        state: FrameState,
        *,
        outputs: list[Output] | None = None,
        result: Json | None = None,
        error: Json | None = None,
        warnings: list[Json] | None = None,
    ) -> None:
        context, totals = self.context, self.shared.totals
        reason = "" if error is None else str(error["type"]).removeprefix("/problems/")
        await self._log(f"{state.value} {reason}".strip())
        if self.run is not None:
            # a client that hears of the end may send the next job of the scene at once, and should find this worker free
            self.run.release()
        async with self.shared.lock:
            now = time.time()
            frame = replace(self.frame, state=state, result=result, error=error, finished_at=now, phase="")
            totals.set(frame)
            totals.add_warnings(warnings or [])
            if self.job.state is JobState.CANCELING:
                totals.cancel_waiting()
            changes: Json = {
                "progress": totals.progress(now),
                "warnings": totals.warnings,
                "usage": totals.usage(),
            }
            if totals.is_over:
                changes["result"] = totals.result()
                if (first := totals.first_error()) is not None:
                    changes["error"] = first
            job = await context.calls.store(
                context.store.end_frame,
                context.fence,
                frame,
                now,
                outputs=outputs or [],
                job_changes=changes,
                webhook_events=("frame.completed",),
            )
        context.metrics.frames_ended[reason or state.value] += 1
        self.is_over = job.state in TERMINAL

    async def _log(self, became: str) -> None:
        """Append to the frame's log: the worker's output, and how it ended."""
        if self.ended is None or self.run is None:
            return
        path = self.context.data.frame(self.job.id, self.frame.number) / adoption.LOG
        signal = "" if self.ended.signal is None else f" {outcomes.signal_name(self.ended.signal)}"
        how = f"{self.ended.reason}{signal}, {self.ended.cpu_s:.1f} CPU s, {self.ended.peak_rss_bytes / 2**20:.0f} MiB"
        title = f"attempt {self.frame.attempt}, chunk {self.run.chunk.id}: {how}; {became}"
        try:
            text = self.ended.log if self.ended.log_file is None else self.ended.log_file
            limits, data = self.context.limits, self.context.data
            await self.context.calls.disk(adoption.append_log, data, path, title, text, limits.log_bytes)
        except OSError:
            self.context.disk_is_full = True


def _is_asked(name: str, command: Json) -> bool:
    """Return whether the command asks for a file of this name. Products name their files, so only the suffix is known."""
    if name in command["outputs"]:
        return True
    products = command.get("products")
    return products is not None and name.rpartition(".")[0].endswith(products["name_end"])


def _stop_of(done: Done, out_of_time: bool) -> Json | None:
    stop = done.report.get("stop")
    if not isinstance(stop, dict) or stop.get("reason") not in ("target-error", "samples", "time-limit", "interrupted"):
        return None
    reason = "time-limit" if out_of_time and stop["reason"] in ("interrupted", "samples") else stop["reason"]
    return {"reason": reason, "target_met": stop.get("target_met")}
