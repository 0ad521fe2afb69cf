"""Taking samples until a rule says stop: which samples come next, when the error is looked at, and what ends the render.

What is decided depends on the samples alone, never on time or threads, but for a time limit and for what is outside: so a
render that was stopped and went on takes the samples of one that ran through. The error is measured at 8 samples a pixel and
each time their number has doubled (anchors); between these it is taken to go on falling as it did. Where that
says that the target is reached, the error is measured again, and the render stops or goes on from there. Rows of the error
that a render has for other reasons (it was interrupted, its samples were at an end, it had another target) decide nothing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from .. import core
from ..settings import MAX_SPP, SAMPLE_BLOCK, Metric, RenderSettings
from .adaptive import Plan, make_plan
from .error import DisplayView, FrameError, measure

FIRST_ANCHOR = 8
FIRST_PLAN = 16  # adaptive sampling begins here
# A squared error that falls slower than 1 / sqrt(samples), or faster than 1 / samples^2, is noise in its measurement; of how
# far the measured power is from 1, the rest is.
SLOWEST, FASTEST, TRUST = 0.5, 2.0, 0.7
USUAL_RATE = 1.2  # at first, before it has been measured
# A pass under a time limit takes at most so much of what is left, so that what it takes is known before the end comes near.
SHARE_OF_TIME = 0.35

LOOK_PIXELS = 1 << 15  # of the first look

# progress(fraction, samples, rays), some ten times a second; False stops the render.
Progress = Callable[[float, int, int], bool | None]
Ends = npt.NDArray[np.uint32]


@dataclass(frozen=True)
class Row:
    """One measurement of the error: after how many samples a pixel (their mean) and seconds of sampling."""

    samples: float
    seconds: float
    error: FrameError
    anchor: bool
    due: bool = False  # the target was expected to be reached here

    @property
    def decides(self) -> bool:
        """Whether any render of these samples with this target would have measured here."""
        return self.anchor or self.due

    def as_json(self) -> dict[str, Any]:
        found = {"samples": self.samples, "seconds": self.seconds, "relmse": self.error.relmse.value}
        return found | {"ci95": [self.error.relmse.low, self.error.relmse.high], "rmse": self.error.rmse.value}


@dataclass(frozen=True)
class Stop:
    """Why a render ended: "target-error", "samples", "time-limit" or "interrupted"."""

    reason: str
    target_met: bool | None  # None: no error was asked for

    def as_json(self) -> dict[str, Any]:
        return {"reason": self.reason, "target_met": self.target_met}


@dataclass
class Sampling:
    """A render under way. `done` counts the samples a pixel whose pass is complete, `ends` is the pass under way."""

    scene: core.CoreScene
    settings: RenderSettings
    film: core.Film
    splits: core.Splits
    done: int = 0
    ends: Ends | None = None
    goal: int = 0
    seconds: float = 0.0
    plan: Plan | None = None
    rows: list[Row] = field(default_factory=list)
    busy_lanes: int = 0
    shaded_lanes: int = 0
    # Of earlier runs, of a render that goes on from a checkpoint: what a time limit (unless told to) and rates don't count.
    earlier_seconds: float = 0.0
    earlier_done: int = 0
    earlier_rays: int = 0
    resumable: bool = False  # measure at anchors what any error metric may be told by later
    pilot: bool = False  # measure at every anchor, and at the end only where there was none
    # For those who watch: a first pass of one block, whose error is looked at, and who is told when a pass is complete.
    first_look: bool = False
    on_pass: Callable[[], None] | None = None
    now_s: float = 0.0  # seconds of sampling, those of the pass under way too
    stop: Stop | None = None
    most_fraction: float = 0.0

    @classmethod
    def begin(cls, scene: core.CoreScene, settings: RenderSettings) -> Sampling:
        film = core.Film(scene)
        sampling = cls(scene, settings, film, core.choose_splits(scene, settings))
        if settings.sample_range is not None:
            sampling.done = settings.sample_range[0]
            film.start_at(sampling.done // SAMPLE_BLOCK)
        return sampling

    def count_as_spent(self, seconds: float) -> None:
        """So much of the time limit is used up, before this run."""
        self.earlier_seconds = self.seconds - seconds

    def run(self, progress: Progress | None = None, pause: Callable[[], bool] | None = None) -> bool:
        """Sample until something stops it: True; or until `pause` answers True in the middle of a pass: False, to be run on.

        Ctrl-C, and `progress` answering False, stop it.
        """
        self.stop = None
        while self.stop is None:
            if self.ends is None:
                self._measure_at_anchor()
                self.stop = self._stop_at_boundary()
                if self.stop is not None:
                    break
                self.aim()
            if self._render_pass(progress, pause) == "paused":
                return False
        if not (self.pilot and self.rows):
            self._measure_at_end()
        return True

    def aim(self) -> None:
        """Choose where the next pass ends, or anew where the pass under way does: by `done` and what decides alone."""
        self.goal = max(self._next_goal(), self.done)
        self.ends = self._ends_at(self.goal)

    def _render_pass(self, progress: Progress | None, pause: Callable[[], bool] | None) -> str:
        why = ""
        start, before = time.perf_counter(), self.seconds
        limit = self.settings.time_limit_s

        def poll(fraction: float) -> bool:
            nonlocal why
            self.now_s = seconds = before + time.perf_counter() - start
            if progress is not None and progress(self._fraction(fraction, seconds), self.film.samples, self.film.rays) is False:
                why = "interrupted"
            elif limit is not None and self.film.samples > 0 and seconds - self.earlier_seconds > limit:
                why = "time-limit"
            elif pause is not None and fraction > 0 and pause():
                why = "paused"
            return not why

        assert self.ends is not None
        # Passes that are over before they are polled would never be interrupted. Pausing here would never get anywhere.
        if not poll(0.0):
            self._end(why)
            return why
        done = core.render_pass(self.scene, self.film, self.ends, self.splits, self.settings, poll)
        self.seconds = before + time.perf_counter() - start
        self.busy_lanes += done.busy_lanes
        self.shaded_lanes += done.shaded_lanes
        if not done.interrupted:
            self.done, self.ends = self.goal, None
            if self.on_pass is not None:
                self.on_pass()
            return "done"
        if why != "paused":
            self._end(why or "interrupted")
        return why

    def _next_goal(self) -> int:
        """The pass's end, in samples a pixel: where the next measurement is due, or before it where time is short."""
        most = self.settings.most_samples
        anchor = FIRST_ANCHOR
        while anchor <= self.done:
            anchor *= 2
        goal = min(anchor, most)
        if self.first_look and self.done == 0:
            goal = min(SAMPLE_BLOCK, most)
        after = (self.done // SAMPLE_BLOCK + 1) * SAMPLE_BLOCK  # an earlier run may have stopped inside a block
        expected = self.expected_end()
        if expected is not None:
            goal = min(goal, max(expected, after))
        if self.settings.time_limit_s is not None:
            goal = min(goal, max(after, self._within_time()))
        return min(goal, most)

    def _within_time(self) -> int:
        """As many samples a pixel as a share of the time that is left should allow."""
        assert self.settings.time_limit_s is not None
        if self.done == 0:
            return SAMPLE_BLOCK
        each = self.seconds / max(self.done, 1)
        more = (self.settings.time_limit_s - self.seconds + self.earlier_seconds) / each
        share = more if more < 2 * SAMPLE_BLOCK else max(SHARE_OF_TIME * more, 2 * SAMPLE_BLOCK)
        return (self.done + int(share)) // SAMPLE_BLOCK * SAMPLE_BLOCK

    def expected_end(self) -> int | None:
        """The first boundary at which the error should have fallen to the target, from the last measurements."""
        target = self.settings.target_error
        row = next((row for row in reversed(self.rows) if row.decides), None)
        if target is None or row is None:
            return None
        metric = self.settings.error_metric
        part = min(target / max(row.error.of(metric).value, 1e-300), 1.0) ** (1.0 if metric is Metric.RELMSE else 2.0)
        rate = self.rate()
        samples = row.samples * math.pow(part, -1 / rate)
        if self.plan is not None and row.samples >= self.plan.samples:
            planned = self.plan.samples_for(row.error.tiles, row.samples, part, 0.5**rate)
            samples = planned if math.isfinite(planned) else max(samples, 2.0 * self.plan.samples + SAMPLE_BLOCK)
        samples = min(samples, float(MAX_SPP))  # whatever else ends the render: see Row.due
        return math.ceil(samples / SAMPLE_BLOCK - 1e-9) * SAMPLE_BLOCK

    def rate(self) -> float:
        """The power of 1 / samples with which squared errors fall, from the last two anchors."""
        metric = self.settings.error_metric
        anchors = [row for row in self.rows if row.anchor]
        if len(anchors) < 2:
            return USUAL_RATE
        before, after = anchors[-2].error.of(metric).value, anchors[-1].error.of(metric).value
        if not (before > 0 and after > 0):
            return USUAL_RATE
        seen = math.log(before / after) / math.log(anchors[-1].samples / anchors[-2].samples)
        if metric is not Metric.RELMSE:
            seen *= 2
        return min(max(1 + TRUST * (seen - 1), SLOWEST), FASTEST)

    def _ends_at(self, samples: int) -> Ends:
        """Where each tile's sequences should stand when pixels have `samples` on average."""
        return core.uniform_ends(self.film, samples) if self.plan is None else self.plan.ends(samples)

    def _last_row(self) -> Row | None:
        return self.rows[-1] if self.rows else None

    def _is_anchor(self) -> bool:
        if self.settings.sample_range is not None or self.done % FIRST_ANCHOR:
            return False
        doublings = (self.done // FIRST_ANCHOR).bit_length() - 1
        if self.done == 0 or self.done != FIRST_ANCHOR << doublings:
            return False
        # Where no target can need them, every other one does for the curve.
        needed = self.settings.target_error is not None or self.settings.adapts or self.resumable or self.pilot
        return needed or doublings % 2 == 1

    def _view(self) -> DisplayView:
        return DisplayView(space=self.scene.rendering_space)

    def _measure(self, *, anchor: bool = False, due: bool = False) -> None:
        last = self._last_row()
        if last is not None and last.samples == self.mean_samples():
            self.rows[-1] = replace(last, anchor=last.anchor or anchor, due=last.due or due)
            return
        start = time.perf_counter()
        shown = self.resumable or self.settings.error_metric is Metric.DISPLAY
        error = measure(self.film, core.threads(self.settings), self._view() if shown else None)
        self.seconds += time.perf_counter() - start
        if error is not None:
            self.rows.append(Row(self.mean_samples(), self.seconds, error, anchor, due))

    def _look(self) -> None:
        """What a few pixels tell of the error, for those who watch."""
        start = time.perf_counter()
        view = self._view() if self.settings.error_metric is Metric.DISPLAY else None
        error = measure(self.film, core.threads(self.settings), view, LOOK_PIXELS)
        self.seconds += time.perf_counter() - start
        if error is not None:
            self.rows.append(Row(self.mean_samples(), self.seconds, error, anchor=False))

    def _measure_at_anchor(self) -> None:
        if self._is_anchor():
            self._measure(anchor=True)
            if self.settings.adapts and self.rows and self.done >= FIRST_PLAN:
                self.plan = make_plan(self.film, self.rows[-1].error.tiles, self.done)
        elif self.first_look and self.done == SAMPLE_BLOCK:
            self._look()
        elif self.settings.target_error is not None and self.done > 0:
            expected = self.expected_end()
            due = expected is not None and self.done >= expected
            if due or self.done >= self.settings.most_samples:
                self._measure(due=due)

    def _measure_at_end(self) -> None:
        """The last row has the whole picture's error, in every measure."""
        last = self._last_row()
        if last is None or last.samples != self.mean_samples() or last.error.display is None:
            start = time.perf_counter()
            error = measure(self.film, core.threads(self.settings), self._view())
            self.seconds += time.perf_counter() - start
            if error is not None and last is not None and last.samples == self.mean_samples():
                self.rows[-1] = replace(last, error=error)
            elif error is not None:
                self.rows.append(Row(self.mean_samples(), self.seconds, error, anchor=False))
        if self.stop is not None:
            self.stop = replace(self.stop, target_met=self._target_met())

    def _target_met(self) -> bool | None:
        target, row = self.settings.target_error, self._last_row()
        if target is None:
            return None
        return (
            row is not None and row.samples == self.mean_samples() and row.error.of(self.settings.error_metric).value <= target
        )

    def _stop_at_boundary(self) -> Stop | None:
        row, limit = self._last_row(), self.settings.time_limit_s
        at_end = self.done >= self.settings.most_samples
        if row is not None and (row.decides or at_end) and self._target_met():
            return Stop("target-error", True)
        if at_end:
            return Stop("samples", None)
        if limit is not None and self.done > self.earlier_done:
            each = self.seconds / self.done
            if self.seconds - self.earlier_seconds + each * SAMPLE_BLOCK > limit:
                return Stop("time-limit", None)
        return None

    def _end(self, reason: str) -> None:
        self.stop = Stop(reason, None)

    def mean_samples(self) -> float:
        """Samples a pixel, averaged over the picture."""
        width, height = self.scene.resolution
        return self.film.samples / (width * height)

    @property
    def lane_occupancy(self) -> float:
        return self.busy_lanes / self.shaded_lanes if self.shaded_lanes else 0.0

    def _fraction(self, of_pass: float, seconds: float) -> float:
        """How much of the render is done, by the rule that will end it first; never less than it was."""
        first = self.settings.sample_range[0] if self.settings.sample_range else 0
        now = self.done + of_pass * (self.goal - self.done)
        by = [(now - first) / (self.settings.most_samples - first)]
        expected = self.expected_end()
        if expected is not None:
            by.append(min(now / expected, 0.99))
        if self.settings.time_limit_s is not None:
            by.append(min((seconds - self.earlier_seconds) / self.settings.time_limit_s, 0.99))
        self.most_fraction = max(self.most_fraction, *by)
        return self.most_fraction
