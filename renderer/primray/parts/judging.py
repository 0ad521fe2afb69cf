"""Decisions from the error of a frame's first samples: whether it ends, and at which sample count it is measured next.

Repeated merges of a few parts, each in its own process, continue from what the last merged checkpoint holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..checkpoints.gathering import Gathering
from ..checkpoints.merge import Merged, all_of, gathered, picture_of_parts
from ..report.report import Costs
from ..sampling.error_curve import ErrorCurve
from ..sampling.sampling import Sampling
from ..sampling.schedule import Stop
from ..settings import Metric


@dataclass(frozen=True)
class Judgement:
    """A decision. `goal`: samples per pixel at which the error decides next, or where the frame ended.

    `expected`: samples per pixel at which the error should reach the target; None: not known yet.
    """

    stop: Stop | None
    goal: int
    expected: int | None


def judged(gathering: Gathering, ending: Mapping[str, Any], curve: ErrorCurve) -> tuple[Sampling, Stop | None]:
    """Return the sampling of the samples from 0 on, measured as one render would measure it, and its stop, if it ends.

    `curve`: earlier measurements.
    """
    sampling = gathering.sampling(gathering.settings(ending))
    sampling.curve = curve
    return sampling, sampling.judge()


def merge_and_judge(paths: Sequence[Path], spp: int | None, target_error: float, metric: str) -> tuple[Merged, Judgement]:
    """Merge parts to the first samples of a frame that ends by its error, or by `spp` samples.

    The first file may be the result of an earlier call, whose measurements are kept. CheckpointError as for `merge`.
    """
    asked = {"spp": spp, "target_error": target_error, "error_metric": metric}
    costs = Costs()
    with costs.stage("render"):
        gathering = gathered(paths)
        before = _deciding(gathering.held[0].curve(target_error, Metric(metric)))
        ending = {**asked, "adaptive": False, "sample_range": None, "time_limit_s": None}
        sampling, stop = judged(gathering, ending, before)
        expected = sampling.expected_end()
        goal = sampling.done if stop is not None else sampling.schedule.next_goal(sampling.done, expected, 0.0)
        _measure(sampling, gathering)
    merged = picture_of_parts(gathering, sampling, costs, {"parts": [str(path) for path in paths]})
    return merged, Judgement(stop, goal, expected)


def _deciding(curve: ErrorCurve) -> ErrorCurve:
    """Return the curve without measurements made for display only, which one render does not have."""
    return replace(curve, rows=tuple(row for row in curve.rows if row.decides))


def _measure(sampling: Sampling, gathering: Gathering) -> None:
    """Measure the error in every metric, whether or not it decides. The rows remain those of the requested target."""
    schedule = sampling.schedule
    sampling.schedule = replace(schedule, settings=replace(schedule.settings, **all_of(gathering.ranges)))
    sampling.run()  # takes no sample
    sampling.schedule = schedule
