"""Where one render ends by its error: by the renderer's own schedule, of errors that a test makes up."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from primray.sampling.error import ErrorCurve, ErrorRow, Estimate, FrameError
from primray.sampling.schedule import Measurement, Schedule
from primray.settings import Metric, RenderSettings

ErrorAt = Callable[[int], float]
Seen = tuple[int, bool, bool]  # samples, whether it was an anchor, whether it was due


def noisy(seed: int) -> ErrorAt:
    """Errors that fall as errors do, measured with some noise."""
    return lambda samples: (1.0 + 0.3 * math.sin(seed + 1.7 * samples)) / samples


@dataclass(frozen=True)
class Judged:
    over: str | None  # why
    goal: int
    expected: int | None
    seen: tuple[Seen, ...]


def judge(done: int, seen: Sequence[Seen], error_at: ErrorAt, target: float, most: int | None = None) -> Judged:
    """Of the first `done` samples, after what was seen before."""
    schedule = Schedule(RenderSettings(target_error=target, spp=most, adaptive=False), resumable=True)
    curve = ErrorCurve(Metric.RELMSE, tuple(_row(*each, error_at) for each in seen))
    why = schedule.measurement(done, schedule.expected_end(curve, None))
    if why is not None and curve.at(done) is None:
        curve = curve.add(_row(done, why is Measurement.ANCHOR, why is Measurement.DUE, error_at))
    stop, expected = schedule.stop(done, curve.at(done), 0.0), schedule.expected_end(curve, None)
    goal = done if stop is not None else schedule.next_goal(done, expected, 0.0)
    rows = tuple((int(row.samples), row.anchor, row.due) for row in curve.rows)
    return Judged(None if stop is None else stop.reason, goal, expected, rows)


def end_of_one(error_at: ErrorAt, target: float, most: int | None = None) -> int:
    """The samples that it has then."""
    found = judge(0, (), error_at, target, most)
    while found.over is None:
        found = judge(found.goal, found.seen, error_at, target, most)
    return found.goal


def _row(samples: int, anchor: bool, due: bool, error_at: ErrorAt) -> ErrorRow:
    error = error_at(samples)
    known = Estimate(error, error, error)
    return ErrorRow(float(samples), 0.0, FrameError(known, known, np.zeros(1), known), anchor, due)
