"""Sampling loop: passes, measurements between them, and requests to pause or stop, until a stopping rule applies."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from .. import core
from ..arrays import Doubles
from ..errors import SettingsError
from ..settings import SAMPLE_BLOCK, Metric, RenderSettings
from ..time_spans import count, span
from .adaptive import Plan, make_plan
from .error import ALL_PIXELS, DisplayView, ErrorCurve, ErrorRow, FrameError, is_measurable, measure
from .schedule import Measurement, Schedule, Stop

LOOK_PIXELS = 1 << 15  # pixels measured for the first look

# progress(fraction, samples, rays), called about ten times a second; returning False stops the render.
Progress = Callable[[float, int, int], bool | None]
Ends = npt.NDArray[np.uint32]


class Judge(Protocol):
    """A stopping rule by another measure than the picture's error."""

    def is_met(self, sampling: Sampling) -> bool: ...


@dataclass(frozen=True)
class Goal:
    """End of the pass in progress: mean samples per pixel, and the end of each tile's sequences."""

    samples: int
    ends: Ends


@dataclass
class Sampling:
    """A render in progress. `done`: samples per pixel of complete passes; `goal`: the pass in progress."""

    scene: core.CoreScene
    film: core.Film
    splits: core.Splits
    schedule: Schedule
    curve: ErrorCurve = field(init=False)
    plan: Plan | None = None
    done: int = 0
    goal: Goal | None = None
    seconds: float = 0.0
    now_s: float = 0.0  # seconds of sampling, including the pass in progress
    busy_lanes: int = 0
    shaded_lanes: int = 0
    earlier_rays: int = 0  # rays of earlier runs, which rates do not count
    on_pass: Callable[[], None] | None = None  # called when a pass is complete
    # Called with a film of the samples of each complete pass alone, once they are merged.
    on_film_of_pass: Callable[[core.Film], None] | None = None
    stop: Stop | None = None
    most_fraction: float = 0.0
    judge_by: Judge | None = None
    mixes: Doubles | None = None  # (M, E, 3) of lights, whose largest error a target applies to (mix_weights.py)
    measures_at_end: bool = True  # for the report; what stops the render is measured whatever this says
    view_fault: str = ""  # why the display error, which is measured wherever a view exists, is missing
    _view: DisplayView | None = None

    def __post_init__(self) -> None:
        self.curve = ErrorCurve(self.settings.metric)

    @classmethod
    def begin(cls, scene: core.CoreScene, settings: RenderSettings) -> Sampling:
        film = core.Film(scene, settings=settings)
        sampling = cls(scene, film, core.choose_splits(scene, settings), Schedule(settings))
        if settings.sample_range is not None:
            sampling.done = settings.sample_range[0]
            film.start_at(sampling.done // SAMPLE_BLOCK)
        return sampling

    @property
    def settings(self) -> RenderSettings:
        return self.schedule.settings

    @property
    def rows(self) -> tuple[ErrorRow, ...]:
        return self.curve.rows

    def count_as_spent(self, seconds: float) -> None:
        """Count `seconds` of the time limit as used before this run."""
        self.schedule = replace(self.schedule, earlier_seconds=self.seconds - seconds)

    def run(self, progress: Progress | None = None, pause: Callable[[], bool] | None = None) -> bool:
        """Sample until a stopping rule applies (True), or until `pause` returns True in mid-pass (False: call again).

        Ctrl-C, and `progress` returning False, stop it.
        """
        self.stop = None
        while self.stop is None:
            if self.goal is None:
                self.stop = self.judge()
                if self.stop is not None:
                    break
                self.aim()
            if self._render_pass(progress, pause) == "paused":
                return False
        if self.measures_at_end and not self.schedule.is_part and not (self.schedule.pilot and self.rows):
            self._measure_at_end()
        return True

    def judge(self) -> Stop | None:
        """Measure the error that is due after a pass, and return the stop if the render ends here."""
        self._measure_at_boundary()
        if self.judge_by is not None and self.schedule.is_judged(self.done) and self._is_met(self.judge_by):
            return Stop("target-error", True)
        return self.schedule.stop(self.done, self._row_here(), self.seconds)

    def aim(self) -> None:
        """Choose the end of the next pass, or again that of the pass in progress, from `done` and the measurements alone."""
        samples = self.schedule.next_goal(self.done, self.expected_end(), self.seconds)
        ends = core.uniform_ends(self.film, samples) if self.plan is None else self.plan.ends(samples)
        self.goal = Goal(samples, ends)

    def expected_end(self) -> int | None:
        """Return the first boundary at which the error should have fallen to the target, from the last measurements."""
        return self.schedule.expected_end(self.curve, self.plan)

    def _render_pass(self, progress: Progress | None, pause: Callable[[], bool] | None) -> str:
        assert self.goal is not None
        why, goal = "", self.goal
        start, before = time.perf_counter(), self.seconds

        def poll(fraction: float) -> bool:
            nonlocal why
            self.now_s = seconds = before + time.perf_counter() - start
            done = self.done + fraction * (goal.samples - self.done)
            if progress is not None and progress(self._fraction(done, seconds), self.film.samples, self.film.rays) is False:
                why = "interrupted"
            elif self.film.samples > 0 and self.schedule.is_out_of_time(seconds):
                why = "time-limit"
            elif pause is not None and fraction > 0 and pause():
                why = "paused"
            return not why

        # Poll before the pass: short passes end before their first poll. Pausing here would keep every pass from progressing.
        if not poll(0.0):
            self._end(why)
            return why
        film = self.film if self.on_film_of_pass is None else core.Film.begun_at(self.scene, self.film.next, self.settings)
        with span("pass", samples=goal.samples - self.done, to=goal.samples):
            done = core.render_pass(self.scene, film, goal.ends, self.splits, self.settings, poll)
        if film is not self.film:
            self.film.merge(film)
        count("samples per pixel", self.mean_samples)
        count("million rays", lambda: self.film.rays / 1e6)
        self.seconds = before + time.perf_counter() - start
        self.busy_lanes += done.busy_lanes
        self.shaded_lanes += done.shaded_lanes
        if not done.interrupted:
            self.done, self.goal = goal.samples, None
            if self.on_pass is not None:
                self.on_pass()
            if self.on_film_of_pass is not None:
                self.on_film_of_pass(film)
            return "done"
        if why != "paused":
            self._end(why or "interrupted")
        return why

    def _end(self, reason: str) -> None:
        self.stop = Stop(reason, None)

    def _fraction(self, done: float, seconds: float) -> float:
        """Return the completed fraction of the render; it never decreases."""
        self.most_fraction = max(self.most_fraction, self.schedule.fraction(done, self.expected_end(), seconds))
        return self.most_fraction

    def _measure_at_boundary(self) -> None:
        why = self.schedule.measurement(self.done, self.expected_end())
        if why is Measurement.ANCHOR:
            self._measure(why)
            if self.rows and self.schedule.plans(self.done):
                self.plan = make_plan(self.film, self.rows[-1].error.tiles, self.done)
        elif why is Measurement.LOOK:
            self._add(self._error(shown=self._is_of_display(), most_pixels=LOOK_PIXELS))
        elif why is not None:
            self._measure(why)

    def _measure(self, why: Measurement) -> None:
        anchor, due = why is Measurement.ANCHOR, why is Measurement.DUE
        here = self._row_here()
        if here is not None:
            self.curve = self.curve.change_last(replace(here, anchor=here.anchor or anchor, due=here.due or due))
        else:
            self._add(self._error(shown=self.schedule.resumable or self._is_of_display()), anchor=anchor, due=due)

    def _measure_at_end(self) -> None:
        """Measure the whole picture's error, in every metric, in the last row."""
        here = self._row_here()
        if here is None or (here.error.display is None and not self.view_fault):
            error = self._error(shown=True)
            if here is None:
                self._add(error)
            elif error is not None:
                self.curve = self.curve.change_last(replace(here, error=error))
        if self.stop is not None:
            met = self.schedule.target_met(self._row_here())
            self.stop = replace(self.stop, target_met=met if self.judge_by is None else self._is_met(self.judge_by))

    def _is_met(self, judge: Judge) -> bool:
        """Return the judge's answer; its time counts as sampling."""
        start = time.perf_counter()
        met = judge.is_met(self)
        self.seconds += time.perf_counter() - start
        return met

    def _add(self, error: FrameError | None, *, anchor: bool = False, due: bool = False) -> None:
        if error is not None:
            self.curve = self.curve.add(ErrorRow(self.mean_samples(), self.seconds, error, anchor, due))

    def _error(self, *, shown: bool, most_pixels: int = ALL_PIXELS) -> FrameError | None:
        """Measure the error, on a display too if `shown`; the time counts as sampling."""
        start = time.perf_counter()
        with span("measure"):
            view = self._display_view() if shown and is_measurable(self.film) else None
            error = measure(self.film, core.threads(self.settings), view, most_pixels, self.mixes)
        self.seconds += time.perf_counter() - start
        return error

    def _display_view(self) -> DisplayView | None:
        """Return the view for display errors; None if it cannot be made, or rests on an assumption that nobody requested.

        SettingsError if the render's target is a display error.
        """
        if self._view is None and not self.view_fault:
            view = DisplayView(space=self.scene.rendering_space)
            try:
                view.check()
                self.view_fault = "" if self._is_of_display() else view.assumed() or ""
                self._view = None if self.view_fault else view
            except SettingsError as error:
                if self._is_of_display():
                    raise
                self.view_fault = error.message
        return self._view

    def _is_of_display(self) -> bool:
        return self.settings.metric is Metric.DISPLAY

    def _row_here(self) -> ErrorRow | None:
        """Return the measured error of exactly the samples taken so far, or None."""
        return self.curve.at(self.mean_samples())

    def mean_samples(self) -> float:
        """Return samples per pixel, averaged over the picture."""
        width, height = self.scene.resolution
        return self.film.samples / (width * height)

    @property
    def lane_occupancy(self) -> float:
        return self.busy_lanes / self.shaded_lanes if self.shaded_lanes else 0.0


class Saving(Protocol):
    """Something that is saved at intervals."""

    def is_due(self) -> bool: ...

    def save_meanwhile(self, sampling: Sampling) -> None: ...


def run_with_saving(sampling: Sampling, progress: Progress | None, savings: Sequence[Saving]) -> None:
    """Sample until a stopping rule applies, and save what is due in between."""
    pause = (lambda: any(saving.is_due() for saving in savings)) if savings else None
    while not sampling.run(progress, pause):
        for saving in savings:
            if saving.is_due():
                saving.save_meanwhile(sampling)
