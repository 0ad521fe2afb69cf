"""Schedule: where passes end, where the error is measured, and when a render stops. Pure decisions from arguments.

Decisions depend on samples only, never on time or threads, except for a time limit: a render that was stopped and resumed takes
the samples of an uninterrupted one. The error is measured at 8 samples per pixel and each time that number has doubled
(anchors); in between it is extrapolated. Where the extrapolation reaches the target, the error is measured again, and the
render stops or continues from there. Rows of the error that exist for other reasons (an interruption, the last sample, another
target) decide nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING, Any

from ..settings import SAMPLE_BLOCK, RenderSettings, StopAt
from .error import FEWEST, ErrorCurve, ErrorRow, fewest_samples

if TYPE_CHECKING:
    from .adaptive import Plan

FIRST_ANCHOR = FEWEST
FIRST_LOOK = 4  # samples for the first denoised picture: each half has two
FIRST_PLAN = 16  # adaptive sampling begins here
# Largest share of the remaining time for one pass, so that the cost of samples is known well before a time limit.
SHARE_OF_TIME = 0.35


@dataclass(frozen=True)
class Stop:
    """Why a render ended: "target-error", "samples", "time-limit" or "interrupted"."""

    reason: str
    target_met: bool | None  # None: there is no target

    def as_json(self) -> dict[str, Any]:
        return {"reason": self.reason, "target_met": self.target_met}


class Measurement(Enum):
    """Reason for measuring the error after a pass."""

    ANCHOR = auto()
    LOOK = auto()  # of a few pixels, for interactive viewers
    DUE = auto()  # where the target should be reached
    AT_END = auto()  # after the last sample, to decide whether the target is met


@dataclass(frozen=True)
class Schedule:
    """Decisions of a render with these settings. `done`: samples per pixel of complete passes."""

    settings: RenderSettings
    resumable: bool = False  # measure every metric at anchors: a resumed render may need another one
    pilot: bool = False  # measure at every anchor, and at the end only if there was none
    is_part: bool = False  # a part of a frame, whose error is measured after merging: none at the end
    first_look: bool = False  # for interactive viewers: measure after a first pass of one block
    # Seconds and samples of earlier runs of a resumed render; a time limit counts them only after `count_as_spent`.
    earlier_seconds: float = 0.0
    earlier_done: int = 0

    @property
    def target_error(self) -> float | None:
        """Target for the picture itself, or a mix of its lights; a target for its denoised form is left to a `Judge`."""
        return None if self.settings.stop_at is StopAt.DENOISED else self.settings.target_error

    @property
    def first(self) -> int:
        """The sample that a render begins with."""
        return self.settings.sample_range[0] if self.settings.sample_range else 0

    def is_anchor(self, done: int) -> bool:
        if self.settings.sample_range is not None or done % FIRST_ANCHOR:
            return False
        doublings = (done // FIRST_ANCHOR).bit_length() - 1
        if done == 0 or done != FIRST_ANCHOR << doublings:
            return False
        # Every other anchor is enough for the curve if no target can need them.
        needed = self.target_error is not None or self.settings.adapts or self.resumable or self.pilot
        return needed or doublings % 2 == 1

    def plans(self, done: int) -> bool:
        """Return whether tiles are planned again at this anchor."""
        return self.settings.adapts and done >= FIRST_PLAN

    def expected_end(self, curve: ErrorCurve, plan: Plan | None) -> int | None:
        """Return the first boundary at which the error should have fallen to the target, from the last measurements."""
        target = self.target_error
        samples = None if target is None else curve.expected_samples(target, plan)
        return None if samples is None else math.ceil(samples / SAMPLE_BLOCK - 1e-9) * SAMPLE_BLOCK

    def measurement(self, done: int, expected: int | None) -> Measurement | None:
        """Return what is measured after a pass; `expected`: where the target should be reached."""
        if self.is_anchor(done):
            return Measurement.ANCHOR
        if self.first_look and done == SAMPLE_BLOCK:
            return Measurement.LOOK
        if self.target_error is None or done == 0:
            return None
        if expected is not None and done >= expected:
            return Measurement.DUE
        return Measurement.AT_END if done >= self.settings.most_samples else None

    def is_judged(self, done: int) -> bool:
        """Return whether a `Judge` is asked here: where any render of these samples would ask it."""
        return done >= FIRST_LOOK and (done == _next_look(done - 1) or done >= self.settings.most_samples)

    def next_goal(self, done: int, expected: int | None, seconds: float) -> int:
        """Return the end of the next pass in samples per pixel: where a measurement is due, or earlier if time is short."""
        most = self.settings.most_samples
        anchor = FIRST_ANCHOR
        while anchor <= done:
            anchor *= 2
        if self.settings.stop_at is StopAt.DENOISED:
            anchor = _next_look(done)
        goal = min(anchor, most)
        if self.first_look and done == 0:
            goal = min(SAMPLE_BLOCK, most)
        after = (done // SAMPLE_BLOCK + 1) * SAMPLE_BLOCK  # a previous run may have stopped inside a block
        if expected is not None:
            goal = min(goal, max(expected, after))
        if self.settings.sampling_time_s is not None:
            goal = min(goal, max(after, self._within_time(self.settings.sampling_time_s, done, seconds)))
        return max(min(goal, most), done)

    def _within_time(self, limit: float, done: int, seconds: float) -> int:
        """Return the samples per pixel that a share of the remaining time should allow."""
        if done == 0:
            return SAMPLE_BLOCK
        each = seconds / max(done, 1)
        more = (limit - seconds + self.earlier_seconds) / each
        share = more if more < 2 * SAMPLE_BLOCK else max(SHARE_OF_TIME * more, 2 * SAMPLE_BLOCK)
        return (done + int(share)) // SAMPLE_BLOCK * SAMPLE_BLOCK

    def target_met(self, here: ErrorRow | None) -> bool | None:
        """Return whether the error of all samples is known to be at most the target; None: there is no target."""
        target = self.target_error
        if target is None:
            return None
        if here is None:
            return False
        error = here.error.of(self.settings.metric)
        return error.value <= target and here.samples >= min(fewest_samples(error.doubt), self.settings.most_samples)

    def stop(self, done: int, here: ErrorRow | None, seconds: float) -> Stop | None:
        """Return the stop if the render ends after this pass; `here`: the error measured there, if it was."""
        limit, at_end = self.settings.sampling_time_s, done >= self.settings.most_samples
        if here is not None and (here.decides or at_end) and self.target_met(here):
            return Stop("target-error", True)
        if at_end:
            return Stop("samples", None)
        if limit is not None and done > self.earlier_done:
            each = seconds / done
            if seconds - self.earlier_seconds + each * SAMPLE_BLOCK > limit:
                return Stop("time-limit", None)
        return None

    def is_out_of_time(self, seconds: float) -> bool:
        limit = self.settings.sampling_time_s
        return limit is not None and seconds - self.earlier_seconds > limit

    def fraction(self, now: float, expected: int | None, seconds: float) -> float:
        """Return the completed fraction at `now` samples per pixel, by the rule that will end the render first."""
        by = [(now - self.first) / (self.settings.most_samples - self.first)]
        if expected is not None:
            by.append(min(now / expected, 0.99))
        if self.settings.sampling_time_s is not None:
            by.append(min((seconds - self.earlier_seconds) / self.settings.sampling_time_s, 0.99))
        return max(by)


def _next_look(done: int) -> int:
    """Return where a denoised picture is next judged: at 4 samples per pixel, powers of two and half-way between them."""
    step = max((1 << max(done.bit_length() - 1, 0)) // 2, FIRST_LOOK)
    return (done // step + 1) * step
