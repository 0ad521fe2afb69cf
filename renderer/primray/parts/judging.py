"""What the error of a frame's first samples decides: whether they are all of it, and at which number it is measured next.

Whoever merges a frame's parts a few at a time, in one process after another, goes on by what the last sum's checkpoint holds.
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
    """`goal`: the number of samples a pixel at which the error decides next; where the frame has ended, those that it has.
    `expected`: at how many the error should have fallen to the target; None: nobody knows yet."""

    stop: Stop | None
    goal: int
    expected: int | None


def judged(gathering: Gathering, ending: Mapping[str, Any], curve: ErrorCurve) -> tuple[Sampling, Stop | None]:
    """The sampling of all that is there, which begins with sample 0; measured where one render would have measured it, and
    whether it would have ended there. `curve`: what was measured before."""
    sampling = gathering.sampling(gathering.settings(ending))
    sampling.curve = curve
    return sampling, sampling.judge()


def merge_and_judge(paths: Sequence[Path], spp: int | None, target_error: float, metric: str) -> tuple[Merged, Judgement]:
    """Merge parts to the first samples of a frame that ends by its error, or by `spp` samples.

    The first file may be what this merged before: what was measured then is taken over. CheckpointError as of `merge`.
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
    """Without what was measured only to tell how it is going: one render has no such rows."""
    return replace(curve, rows=tuple(row for row in curve.rows if row.decides))


def _measure(sampling: Sampling, gathering: Gathering) -> None:
    """In every measure, whether or not something is decided by it. The rows stay those of the target that is asked for."""
    schedule = sampling.schedule
    sampling.schedule = replace(schedule, settings=replace(schedule.settings, **all_of(gathering.ranges)))
    sampling.run()  # takes no sample
    sampling.schedule = schedule
