"""Writing down how a frame's run ended: its outputs and its row, so that a crash at any point leaves what the next dispatcher
ends in the same way."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass, replace

from ..executor.base import Ended
from ..jobs import TERMINAL, Frame, FrameState, Job, JobState, Json, Output
from ..limits import Limits
from ..problems import Problem
from . import adoption, endings
from .chunk_run import ChunkRun
from .endings import Again, Broken, Given, Outcome
from .lease import TTL_S
from .messages import Done
from .parts import Parts, SharedJob
from .totals import frame_result, target_warning

FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.25, 5.0  # before a frame whose worker was killed again and again is tried once more


def not_begun(frame: Frame, error: Exception, limits: Limits) -> Outcome:
    """What becomes of a frame whose chunk could not be made or submitted."""
    if isinstance(error, Problem) and error.slug != "unavailable":
        return Broken(error.as_json())
    if isinstance(error, ValueError):
        return Broken(Problem("settings-rejected", f"No render could follow these settings: {error}.").as_json())
    frame = replace(frame, kills=frame.kills + 1)
    if frame.kills < limits.kills:
        return Again(frame, "unavailable")
    return Broken(Problem("unavailable", "The server could not start a render process.").as_json())


@dataclass
class Ending:
    """Of one run; `is_over` says whether the job is at its end too."""

    parts: Parts
    shared: SharedJob
    job: Job
    frame: Frame
    run: ChunkRun | None
    ended: Ended | None
    is_over: bool = False

    async def with_picture(self, done: Done, *, out_of_time: bool) -> Outcome | None:
        """Adopt the outputs and end the frame; another outcome if that cannot be."""
        began = time.monotonic()
        canceling = self.job.state is JobState.CANCELING
        if not done.outputs:
            return Given() if canceling else Broken(Problem("render-failed", "It made no picture.").as_json())
        stop = _stop_of(done, out_of_time)
        if stop is None:
            return Broken(Problem("render-failed", "The render process did not say why it ended.").as_json())
        earlier = await self._earlier_outputs()
        try:
            outputs = await self._adopt(done)
        except adoption.NotAdopted as error:
            return Broken(Problem("render-failed", f"Its outputs are not what the render process said: {error}.").as_json())
        except OSError:
            self.parts.disk_is_full = True
            return Again(self.frame, "storage")
        names = [output.name for output in outputs]
        result = frame_result(done.report, stop, self.job, names)
        warning = target_warning(self.frame, result, len(self.shared.totals))
        state = FrameState.CANCELED if canceling else FrameState.SUCCEEDED
        await self._end(state, outputs=outputs, result=result, warnings=[] if warning is None or canceling else [warning])
        await self.parts.calls.disk(
            adoption.remove_outputs, self.parts.data.outputs(self.job.id), [name for name in earlier if name not in names]
        )
        self.parts.metrics.end_frame.observe(time.monotonic() - began)
        return None

    async def without(self, state: FrameState, problem: Json | None) -> None:
        """End the frame without a picture."""
        await self._end(state, error=None if problem is None else {**problem, "attempt": self.frame.attempt})

    async def again(self, outcome: Again) -> None:
        parts, frame = self.parts, outcome.frame
        await self._log(f"goes on later: {outcome.why}")
        if frame.kills > 1:
            await asyncio.sleep(min(FIRST_PAUSE_S * 2.0 ** (frame.kills - 2), LONGEST_PAUSE_S))
        if outcome.drop_checkpoint and frame.checkpoint_file:
            await parts.calls.disk(adoption.remove, parts.data.job(self.job.id) / frame.checkpoint_file)
        async with self.shared.lock:
            parts.metrics.restarts[outcome.why] += 1
            waiting = replace(frame, state=FrameState.QUEUED, phase="")
            self.shared.totals.set(waiting)
            job = await parts.calls.store(parts.store.requeue_frame, parts.fence, frame, time.time())
        self.is_over = job.state in TERMINAL

    async def _earlier_outputs(self) -> list[str]:
        """Of earlier attempts: their rows go when the frame ends, their files after that."""
        if self.job.attempt == 1:
            return []
        rows = await self.parts.calls.store(self.parts.store.outputs, self.job.id)
        return [row.name for row in rows if row.frame == self.frame.number]

    async def _adopt(self, done: Done) -> list[Output]:
        parts, job, frame = self.parts, self.job, self.frame
        assert self.run is not None
        assert self.ended is not None
        if {made.name for made in done.outputs} - set(self.run.chunk.command["outputs"]):
            raise adoption.NotAdopted("there is one that was not asked for")
        adopted = await parts.calls.disk(
            adoption.adopt_outputs,
            done.outputs,
            self.ended.folder,
            parts.data.frame(job.id, frame.number),
            parts.limits.output_bytes,
            self.run.chunk.id,
        )
        outputs, now = [], time.time()
        folder = parts.data.outputs(job.id)
        for made, kept in adopted:
            if not await parts.calls.disk(adoption.publish_new, kept, folder / made.name):
                # A server that died left it before its row was written; or one that has the lease now has been here.
                await parts.calls.store(parts.store.renew_lease, parts.fence, time.time(), TTL_S)
                await parts.calls.disk(adoption.publish_over, kept, folder / made.name)
            outputs.append(Output(job.id, made.name, frame.number, made.bytes, made.sha256, made.media_type, now))
        await parts.calls.disk(adoption.published, folder)
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
        parts, totals = self.parts, self.shared.totals
        reason = "" if error is None else str(error["type"]).removeprefix("/problems/")
        await self._log(f"{state.value} {reason}".strip())
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
            job = await parts.calls.store(
                parts.store.end_frame,
                parts.fence,
                frame,
                now,
                outputs=outputs or [],
                job_changes=changes,
                webhook_events=("frame.completed",),
            )
        parts.metrics.frames_ended[reason or state.value] += 1
        self.is_over = job.state in TERMINAL

    async def _log(self, became: str) -> None:
        """Into the frame's log: what its worker printed, and how it ended."""
        if self.ended is None or self.run is None:
            return
        path = self.parts.data.frame(self.job.id, self.frame.number) / adoption.LOG
        signal = "" if self.ended.signal is None else f" {endings.signal_name(self.ended.signal)}"
        how = f"{self.ended.reason}{signal}, {self.ended.cpu_s:.1f} CPU s, {self.ended.peak_rss_bytes / 2**20:.0f} MiB"
        title = f"attempt {self.frame.attempt}, chunk {self.run.chunk.id}: {how}; {became}"
        try:
            text = self.ended.log if self.ended.log_file is None else self.ended.log_file
            await self.parts.calls.disk(adoption.append_log, path, title, text, self.parts.limits.log_bytes)
        except OSError:
            self.parts.disk_is_full = True


def _stop_of(done: Done, out_of_time: bool) -> Json | None:
    stop = done.report.get("stop")
    if not isinstance(stop, dict) or stop.get("reason") not in ("target-error", "samples", "time-limit", "interrupted"):
        return None
    reason = "time-limit" if out_of_time and stop["reason"] == "interrupted" else stop["reason"]
    return {"reason": reason, "target_met": stop.get("target_met")}
