"""A distributed frame: submits ranges of samples, merges results, measures the error, and stops.

It stops where one render with uniform sampling would: the error is measured at the same sample counts (Schedule), each time
over exactly the samples up to there. The picture therefore depends on the settings alone, not on which process rendered which
part, or on losses. Slots that would idle until a measurement render samples beyond it; those that the picture does not need are
discarded.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

from ..checkpoints.gathering import Gathering
from ..checkpoints.merge import Merged, all_of, picture_of_parts
from ..errors import CheckpointError, RenderCancelled
from ..report.report import Costs
from ..sampling.error_curve import ErrorCurve
from ..sampling.sampling import Progress, Sampling
from ..sampling.schedule import Schedule, Stop
from ..settings import RenderSettings
from .asked import as_told, by_samples, check
from .board import MOST_AHEAD, Range
from .executor import PartsExecutor
from .handing_out import Arrived, HandingOut
from .judging import judged
from .pace import Pace

NOT_WHOLE = ("checkpoint-missing", "checkpoint-damaged")


def gather(
    executor: PartsExecutor, stage: str, asked: RenderSettings, costs: Costs, progress: Progress | None = None
) -> Merged:
    """Render a frame in parts on the executor; `progress` returning False stops it with the samples so far.

    PrimrayError if a part cannot be rendered or too many are lost; RenderCancelled if nothing was rendered.
    """
    check(asked)
    with costs.stage("render"), tempfile.TemporaryDirectory(prefix="primray-parts-") as folder:
        try:
            executor.begin(stage)
            frame = _Frame(executor, asked, Path(folder))
            sampling = frame.run(progress)
        finally:
            executor.end()
        sampling.film.image()
    return picture_of_parts(frame.gathering, sampling, costs, {"distribution": frame.as_json()})


class _Frame:
    def __init__(self, executor: PartsExecutor, asked: RenderSettings, folder: Path) -> None:
        self.gathering = Gathering()
        self._asked = asked
        self._out = HandingOut(executor, asked, folder)
        self._schedule = Schedule(replace(asked, **by_samples(asked)), resumable=True)
        self._curve = ErrorCurve(asked.metric)
        self._pace = Pace()
        self._waiting: dict[Range, Arrived] = {}  # beyond the goal
        self._goal = 0  # the sample count at which the error is measured next, or the frame ends
        self._start = time.monotonic()
        self._most_fraction = 0.0
        self._aim()

    def run(self, progress: Progress | None) -> Sampling:
        """Submit and merge parts until a stopping rule applies."""
        try:
            while True:
                self._out.give(self._next_part)
                for arrived in self._out.arrived():
                    self._waiting[arrived.part] = arrived
                self._merge_within(self._goal)
                if (sampling := self._judged()) is not None:
                    return self._ended(sampling)
                if self._is_stopped(progress):
                    return self._so_far("interrupted")
                if self._is_out_of_time():
                    return self._so_far("time-limit")
        finally:
            self._out.drop()

    def _aim(self) -> None:
        """Set the next goal, and discard parts across it: they hold samples that one render would not have taken by then."""
        if self._asked.target_error is None:
            self._goal = self._schedule.settings.most_samples
            return
        self._goal = self._schedule.next_goal(self._goal, self._expected_end(), 0.0)
        across = self._out.board.across(self._goal)
        self._out.drop(across)
        self._leave_out([part for part in across if part in self._waiting])

    def _expected_end(self) -> int | None:
        return self._schedule.expected_end(self._curve, None)

    def _next_part(self, slots: int) -> Range | None:
        board = self._out.board
        end = board.reach(self._goal, self._expected_end(), self._schedule.settings.most_samples)
        if end > self._goal and len(self._waiting) >= MOST_AHEAD * slots:
            return None
        return board.next_part(self._goal, end, self._pace.samples(board.left(end), slots, self._time_left_s()))

    def _merge_within(self, end: int) -> None:
        for part in sorted(part for part in self._waiting if part[1] <= end):
            arrived = self._waiting.pop(part)
            try:
                held = self.gathering.add(arrived.file)
            except CheckpointError as error:
                if error.code not in NOT_WHOLE:
                    raise
                self._out.is_lost(part, str(error))
                continue
            finally:
                arrived.file.unlink(missing_ok=True)
            self._out.is_used()
            self._pace = self._pace.seen(part[1] - part[0], held.seconds, arrived.wall_s)

    def _judged(self) -> Sampling | None:
        """Measure the error whenever all samples up to the goal are merged; return the sampling if that ends the frame."""
        while self.gathering.ranges == ((0, self._goal),):
            sampling, stop = judged(self.gathering, by_samples(self._asked), self._curve)
            self._curve = sampling.curve
            if stop is not None:
                return sampling
            self._aim()
            self._merge_within(self._goal)
        return None

    def _ended(self, sampling: Sampling) -> Sampling:
        """Return the finished sampling.

        Running it takes no sample: the rule that ended the frame applies at once.
        """
        self._out.drop()
        self._leave_out(list(self._waiting))
        sampling.run()
        sampling.schedule = replace(sampling.schedule, settings=replace(sampling.settings, **as_told(self._asked)))
        return sampling

    def _so_far(self, reason: str) -> Sampling:
        """Return the sampling of all samples that arrived, also those beyond the goal."""
        self._merge_within(self._schedule.settings.most_samples)
        if not self.gathering.ranges:
            raise RenderCancelled("the render was stopped before any part was complete")
        self._out.drop()
        sampling = self.gathering.sampling(self.gathering.settings(all_of(self.gathering.ranges)))
        sampling.curve = self._curve
        sampling.run()  # takes no sample; measures
        sampling.stop = Stop(reason, self._schedule.target_met(sampling.curve.last))
        if self.gathering.ranges[0][0] == 0 and len(self.gathering.ranges) == 1:
            sampling.schedule = replace(sampling.schedule, settings=replace(sampling.settings, **as_told(self._asked)))
        return sampling

    def _leave_out(self, parts: list[Range]) -> None:
        for part in parts:
            self._waiting.pop(part).file.unlink(missing_ok=True)
            self._out.is_left_out(part)

    def _is_stopped(self, progress: Progress | None) -> bool:
        done = sum(b - a for a, b in self.gathering.ranges)
        fraction = self._schedule.fraction(done, self._expected_end(), 0.0)
        if self._asked.time_limit_s is not None:
            fraction = max(fraction, min((time.monotonic() - self._start) / self._asked.time_limit_s, 0.99))
        self._most_fraction = max(self._most_fraction, fraction)
        return progress is not None and progress(self._most_fraction, *self.gathering.counts) is False

    def _is_out_of_time(self) -> bool:
        """Return whether the time limit is over and there is a picture."""
        left = self._time_left_s()
        return left is not None and left <= 0 and bool(self.gathering.ranges or self._waiting)

    def _time_left_s(self) -> float | None:
        limit = self._asked.time_limit_s
        return None if limit is None else limit - (time.monotonic() - self._start)

    def as_json(self) -> dict[str, int]:
        """Return the report's facts about the distribution."""
        out = self._out
        return {"parts": len(self.gathering.held), "lost": out.lost, "left_out": out.left_out, "slots": out.most_slots}
