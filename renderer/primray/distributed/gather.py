"""A distributed frame: submits ranges of samples, merges results, measures the error, and stops.

It stops where one render with uniform sampling would: the error is measured at the same sample counts (Schedule), each time
over exactly the samples up to there. The picture therefore depends on the settings alone, not on which process rendered which
part, or on losses. Slots that would idle until a measurement render samples beyond it; those that the picture does not need are
discarded.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..aovs import DEEP
from ..checkpoints.merge import Merged, MergedParts, merged_parts, picture_of_parts, rules_for_all
from ..denoising.denoiser import check_denoiser
from ..errors import CheckpointError, PrimrayError, RenderCancelled, SettingsError
from ..report.report import Costs
from ..sampling.error import DisplayView, ErrorCurve
from ..sampling.sampling import Progress, Sampling
from ..sampling.schedule import Schedule, Stop
from ..settings import Metric, RenderSettings, StopAt
from ..settings.light_mixes import NO_MIXES
from .executor import PartLost, PartsExecutor, PartsWithdrawn
from .planner import MOST_AHEAD, AssignedRanges, PartCosts, Range, part_settings, samples_of_next_part

MOST_WITHDRAWN = 8  # times that a frame begins again
NOT_WHOLE = ("checkpoint-missing", "checkpoint-damaged")


def gather(
    executor: PartsExecutor, stage: str, asked: RenderSettings, costs: Costs, progress: Progress | None = None
) -> Merged:
    """Render a frame in parts on the executor; `progress` returning False stops it with the samples so far.

    PrimrayError if a part cannot be rendered or too many are lost; RenderCancelled if nothing was rendered.
    """
    check_distributable(asked)
    with costs.stage("render"), tempfile.TemporaryDirectory(prefix="primray-parts-") as folder:
        try:
            executor.begin(stage)
            frame, sampling = _sampled(executor, stage, asked, Path(folder), progress)
        finally:
            executor.end()
        sampling.film.image()
    return picture_of_parts(frame.gathering, sampling, costs, {"distribution": frame.as_json()})


def _sampled(
    executor: PartsExecutor, stage: str, asked: RenderSettings, folder: Path, progress: Progress | None
) -> tuple[_Frame, Sampling]:
    """Return the frame and its sampling, begun again where parts of it are withdrawn; PrimrayError if that does not end."""
    why = ""
    for attempt in range(MOST_WITHDRAWN + 1):
        frame = _Frame(executor, asked, folder / str(attempt))
        try:
            return frame, frame.run(progress)
        except PartsWithdrawn as withdrawn:
            why = str(withdrawn)
            executor.end()
            executor.begin(stage)
    raise PrimrayError(f"the frame began again {MOST_WITHDRAWN} times; the last: {why}", code="parts-withdrawn")


class _Frame:
    def __init__(self, executor: PartsExecutor, asked: RenderSettings, folder: Path) -> None:
        folder.mkdir()
        self.gathering = MergedParts()
        self._asked = asked
        self._out = Submissions(executor, asked, folder)
        self._schedule = Schedule(replace(asked, **sample_rules(asked)), resumable=True)
        self._curve = ErrorCurve(asked.metric)
        self._part_costs = PartCosts()
        self._waiting: dict[Range, FinishedPart] = {}  # beyond the goal
        self._goal = 0  # the sample count at which the error is measured next, or the frame ends
        self._start = time.monotonic()
        self._most_fraction = 0.0
        self._fits = True  # the next part would be finished in time
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
        samples = samples_of_next_part(board.left(end), slots, self._part_costs, self._time_left_s())
        self._fits = samples > 0 or not self._has_picture()
        if not self._fits:
            return None
        return board.next_part(self._goal, end, samples)

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
            overhead_s = max(arrived.wall_s - held.seconds, 0.0)
            self._part_costs = self._part_costs.with_part(part[1] - part[0], held.seconds, overhead_s)

    def _judged(self) -> Sampling | None:
        """Measure the error whenever all samples up to the goal are merged; return the sampling if that ends the frame."""
        while self.gathering.ranges == ((0, self._goal),):
            sampling, stop = judge_parts(self.gathering, sample_rules(self._asked), self._curve)
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
        sampling.schedule = replace(sampling.schedule, settings=replace(sampling.settings, **reported_rules(self._asked)))
        return sampling

    def _so_far(self, reason: str) -> Sampling:
        """Return the sampling of all samples that arrived, also those beyond the goal."""
        self._merge_within(self._schedule.settings.most_samples)
        if not self.gathering.ranges:
            raise RenderCancelled("the render was stopped before any part was complete")
        self._out.drop()
        sampling = self.gathering.sampling(self.gathering.settings(rules_for_all(self.gathering.ranges)))
        sampling.curve = self._curve
        sampling.run()  # takes no sample; measures
        sampling.stop = Stop(reason, self._schedule.target_met(sampling.curve.last))
        if self.gathering.ranges[0][0] == 0 and len(self.gathering.ranges) == 1:
            sampling.schedule = replace(sampling.schedule, settings=replace(sampling.settings, **reported_rules(self._asked)))
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
        """Return whether there is a picture, and the time limit is over or no part would be finished before it."""
        left = self._time_left_s()
        return left is not None and self._has_picture() and (left <= 0 or (not self._fits and self._out.is_idle))

    def _has_picture(self) -> bool:
        return bool(self.gathering.ranges or self._waiting)

    def _time_left_s(self) -> float | None:
        limit = self._asked.time_limit_s
        return None if limit is None else limit - (time.monotonic() - self._start)

    def as_json(self) -> dict[str, int]:
        """Return the report's facts about the distribution."""
        out = self._out
        return {"parts": len(self.gathering.held), "lost": out.lost, "left_out": out.left_out, "slots": out.most_slots}


LOOK_EVERY_S = 0.1
MOST_LOST = 5  # lost parts in a row for each slot, after which the frame fails
NOWHERE_S = 300.0  # the frame fails after this long without a slot

Wanted = Callable[[int], Range | None]  # the next range to render, given the number of slots


@dataclass(frozen=True)
class FinishedPart:
    part: Range
    file: Path
    wall_s: float  # since it was submitted


@dataclass(frozen=True)
class _Submitted:
    part: Range
    file: Path
    at: float


class Submissions:
    """Parts in flight. `board` knows all assigned and finished ranges; files are written to `folder`."""

    def __init__(self, executor: PartsExecutor, asked: RenderSettings, folder: Path) -> None:
        self.board = AssignedRanges()
        self.most_slots = 0
        self.lost = 0
        self.left_out = 0  # parts rendered or started, and discarded
        self._executor = executor
        self._asked = asked
        self._folder = folder
        self._given: dict[Future[None], _Submitted] = {}
        self._made = 0
        self._lost_in_a_row = 0
        self._slot_seen = time.monotonic()

    def give(self, wanted: Wanted) -> None:
        """Submit parts while there are free slots; PrimrayError if there has been no slot for long."""
        slots = self._executor.slots()
        self.most_slots = max(self.most_slots, slots)
        if slots:
            self._slot_seen = time.monotonic()
        elif time.monotonic() - self._slot_seen > NOWHERE_S:
            raise PrimrayError(f"no worker was available for {NOWHERE_S:g} s", code="parts-nowhere")
        while len(self._given) < slots and (part := wanted(slots)) is not None:
            self._made += 1
            given = _Submitted(part, self._folder / f"{part[0]}-{part[1]}-{self._made}.prc", time.monotonic())
            self.board.take(part)
            self._given[self._executor.submit(part_settings(self._asked, part), given.file)] = given

    @property
    def is_idle(self) -> bool:
        return not self._given

    def arrived(self) -> list[FinishedPart]:
        """Return parts that finished, after a short wait; PrimrayError for errors that any part would have, and too many
        losses."""
        wait(list(self._given), LOOK_EVERY_S, FIRST_COMPLETED)
        if not self._given:
            time.sleep(LOOK_EVERY_S)
        found = []
        for future in [future for future in self._given if future.done()]:
            given = self._given.pop(future)
            try:
                future.result()
            except PartLost as lost:
                self.is_lost(given.part, str(lost))
            else:
                found.append(FinishedPart(given.part, given.file, time.monotonic() - given.at))
        return found

    def is_lost(self, part: Range, why: str) -> None:
        """Free the range for another attempt; PrimrayError after too many losses in a row."""
        self.board.give_back(part)
        self.lost += 1
        self._lost_in_a_row += 1
        if self._lost_in_a_row > MOST_LOST * max(self.most_slots, 1):
            sentence = f"{self._lost_in_a_row} parts in a row were lost; the last: {why}"
            raise PrimrayError(sentence, where=f"samples {part[0]}:{part[1]}", code="parts-lost")

    def is_used(self) -> None:
        """Reset the count of losses in a row: a part was complete."""
        self._lost_in_a_row = 0

    def is_left_out(self, part: Range) -> None:
        self.board.give_back(part)
        self.left_out += 1

    def drop(self, parts: list[Range] | None = None) -> None:
        """Cancel these parts (None: all)."""
        for future, given in list(self._given.items()):
            if parts is None or given.part in parts:
                del self._given[future]
                future.cancel()
                self.is_left_out(given.part)


@dataclass(frozen=True)
class Judgement:
    """A decision. `goal`: samples per pixel at which the error decides next, or where the frame ended.

    `expected`: samples per pixel at which the error should reach the target; None: not known yet.
    """

    stop: Stop | None
    goal: int
    expected: int | None


def judge_parts(gathering: MergedParts, ending: Mapping[str, Any], curve: ErrorCurve) -> tuple[Sampling, Stop | None]:
    """Return the sampling of the samples from 0 on, measured as one render would measure it, and its stop, if it ends.

    `curve`: earlier measurements.
    """
    sampling = gathering.sampling(gathering.settings(ending))
    sampling.curve = curve
    return sampling, sampling.judge()


def merge_and_judge(
    paths: Sequence[Path], spp: int | None, target_error: float, metric: str, mixes: Sequence[str] = ()
) -> tuple[Merged, Judgement]:
    """Merge parts to the first samples of a frame that ends by its error, or that of mixes of its lights, or by `spp` samples.

    The first file may be the result of an earlier call, whose measurements are kept. CheckpointError as for `merge`.
    """
    asked: dict[str, Any] = {"spp": spp, "target_error": target_error, "error_metric": metric}
    asked |= {"stop_at": StopAt.MIX.value, "mixes": list(mixes)} if mixes else {}
    costs = Costs()
    with costs.stage("render"):
        gathering = merged_parts(paths)
        before = _deciding(gathering.held[0].curve(target_error, Metric(metric)))
        ending = {**asked, "adaptive": False, "sample_range": None, "time_limit_s": None}
        sampling, stop = judge_parts(gathering, ending, before)
        expected = sampling.expected_end()
        goal = sampling.done if stop is not None else sampling.schedule.next_goal(sampling.done, expected, 0.0)
        _measure(sampling, gathering)
    merged = picture_of_parts(gathering, sampling, costs, {"parts": [str(path) for path in paths]})
    return merged, Judgement(stop, goal, expected)


def _deciding(curve: ErrorCurve) -> ErrorCurve:
    """Return the curve without measurements made for display only, which one render does not have."""
    return replace(curve, rows=tuple(row for row in curve.rows if row.decides))


def _measure(sampling: Sampling, gathering: MergedParts) -> None:
    """Measure the error in every metric, whether or not it decides. The rows remain those of the requested target."""
    schedule = sampling.schedule
    rules = {**rules_for_all(gathering.ranges), **NO_MIXES}
    sampling.schedule = replace(schedule, settings=replace(schedule.settings, **rules))
    sampling.run()  # takes no sample
    sampling.schedule = schedule


def check_distributable(asked: RenderSettings) -> None:
    """Raise SettingsError for settings that a distributed frame cannot have."""
    faults = {
        "adaptive": asked.adaptive is True and "adaptive sampling cannot be rendered in parts",
        "sample_range": asked.sample_range is not None and "a frame in parts has all samples: leave the sample range out",
        "stop_at": asked.stop_at is StopAt.DENOISED
        and "a frame in parts can stop at the picture's error, not at the denoised one's",
        "aovs": DEEP in (asked.aovs or ()) and "a deep picture cannot be rendered in parts: leave out --aov deep",
        "spp": asked.is_quick_look and "a quick look has too few samples for parts: render it without them",
    }
    for name, fault in faults.items():
        if fault:
            raise SettingsError(fault, where=name, code="parts-setting")
    if asked.denoise:
        check_denoiser()
    if asked.metric is Metric.DISPLAY:  # measured in this process
        DisplayView().check()


def sample_rules(asked: RenderSettings) -> dict[str, Any]:
    """Return the stopping rules by samples alone: the time limit is one of wall-clock time, and applied by the caller."""
    spp = asked.most_samples if asked.target_error is None else asked.spp
    return {"spp": spp, **_uniform(asked), "time_limit_s": None}


def reported_rules(asked: RenderSettings) -> dict[str, Any]:
    """Return the stopping rules as the report of one render has them."""
    spp = asked.spp if asked.stops_early else asked.most_samples
    return {"spp": spp, **_uniform(asked), "time_limit_s": asked.time_limit_s}


def _uniform(asked: RenderSettings) -> dict[str, Any]:
    adaptive = asked.adaptive if asked.target_error is None else False
    mixes = {"stop_at": asked.stop_at, "mixes": asked.mixes} if asked.mixes else {}
    return {"target_error": asked.target_error, "adaptive": adaptive, "sample_range": None, **mixes}
