"""What a schedule decides, told of samples, seconds and errors: no film and no core takes part."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest

from primray.sampling.error import USUAL_RATE, ErrorCurve, ErrorRow, Estimate, FrameError
from primray.sampling.schedule import Measurement, Schedule, Stop
from primray.settings import MAX_SPP, Metric, RenderSettings


def schedule(**values: Any) -> Schedule:
    own = {name: values.pop(name) for name in list(values) if name in Schedule.__dataclass_fields__}
    return Schedule(RenderSettings(**values), **own)


def row(samples: float, error: float, *, anchor: bool = True, due: bool = False) -> ErrorRow:
    known = Estimate(error, error, error)
    return ErrorRow(samples, samples / 10, FrameError(known, known, np.ones(1), known), anchor, due)


def curve(*rows: ErrorRow, metric: Metric = Metric.RELMSE) -> ErrorCurve:
    return ErrorCurve(metric, rows)


def goals(of: Schedule, expected: int | None = None) -> list[int]:
    """Where passes end that take no time, one after the other."""
    found = [of.next_goal(of.first, expected, 0.0)]
    while found[-1] < of.settings.most_samples:
        found.append(of.next_goal(found[-1], expected, 0.0))
    return found


def test_it_does_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        schedule().pilot = True  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError):
        curve().rows = ()  # type: ignore[misc]


def test_passes_end_where_samples_have_doubled() -> None:
    assert goals(schedule(spp=100)) == [8, 16, 32, 64, 100]
    assert goals(schedule(spp=2)) == [2]


def test_a_first_look_is_one_block() -> None:
    assert goals(schedule(spp=20, first_look=True)) == [2, 8, 16, 20]


def test_a_range_begins_at_its_first_sample() -> None:
    assert goals(schedule(sample_range=(12, 40))) == [16, 32, 40]


def test_a_pass_ends_where_the_target_should_be_reached() -> None:
    of = schedule(spp=100, target_error=1e-3)
    assert of.next_goal(16, 24, 0.0) == 24
    assert of.next_goal(16, 10, 0.0) == 18  # it was expected before: one block more
    assert of.next_goal(17, 10, 0.0) == 18  # an earlier run had stopped inside a block


@pytest.mark.parametrize(
    ("done", "seconds", "goal"),
    [
        (0, 0.0, 2),  # nothing is known yet
        (8, 0.8, 16),  # 92 more fit: a third of them would, beyond the anchor
        (64, 6.4, 76),  # 36 more fit
        (90, 9.0, 94),  # no less than two blocks
        (98, 9.8, 100),  # or what fits
    ],
)
def test_under_a_time_limit_a_pass_takes_a_share_of_what_is_left(done: int, seconds: float, goal: int) -> None:
    assert schedule(time_limit_s=10.0).next_goal(done, None, seconds) == goal


def test_seconds_of_earlier_runs_are_not_of_the_limit() -> None:
    of = schedule(time_limit_s=10.0, earlier_seconds=50.0, earlier_done=500)
    assert not of.is_out_of_time(60.0)
    assert of.is_out_of_time(60.1)
    assert of.stop(500, None, 50.0) is None
    assert of.stop(598, None, 59.9) == Stop("time-limit", None)


def test_anchors_are_measured_where_something_rests_on_them() -> None:
    at = (0, 4, 8, 12, 16, 32, 64, 128)
    assert [n for n in at if schedule(spp=128, target_error=1.0).is_anchor(n)] == [8, 16, 32, 64, 128]
    assert [n for n in at if schedule(spp=128, resumable=True).is_anchor(n)] == [8, 16, 32, 64, 128]
    assert [n for n in at if schedule(spp=128, pilot=True).is_anchor(n)] == [8, 16, 32, 64, 128]
    assert [n for n in at if schedule(spp=128).is_anchor(n)] == [16, 64]
    assert not any(schedule(sample_range=(0, 128)).is_anchor(n) for n in at)


def test_why_the_error_is_measured() -> None:
    of = schedule(spp=100, target_error=1e-3, first_look=True)
    assert of.measurement(0, None) is None
    assert of.measurement(2, None) is Measurement.LOOK
    assert of.measurement(16, None) is Measurement.ANCHOR
    assert of.measurement(20, 24) is None
    assert of.measurement(24, 24) is Measurement.DUE
    assert of.measurement(100, None) is Measurement.AT_END
    assert schedule(spp=100).measurement(100, None) is None


def test_tiles_are_judged_from_the_second_anchor_on() -> None:
    assert [n for n in (8, 16, 32) if schedule(adaptive=True).plans(n)] == [16, 32]
    assert not schedule(spp=64, adaptive=False).plans(32)


def test_samples_end_it() -> None:
    assert schedule(spp=64).stop(32, None, 0.0) is None
    assert schedule(spp=64).stop(64, None, 0.0) == Stop("samples", None)


def test_a_target_ends_it_where_a_row_decides() -> None:
    of = schedule(spp=64, target_error=1e-3)
    met = (32, 1e-3)
    assert of.stop(32, row(*met), 0.0) == Stop("target-error", True)
    assert of.stop(32, row(*met, anchor=False, due=True), 0.0) == Stop("target-error", True)
    assert of.stop(32, row(*met, anchor=False), 0.0) is None
    assert of.stop(64, row(64, 1e-3, anchor=False), 0.0) == Stop("target-error", True)
    assert of.stop(32, row(32, 2e-3), 0.0) is None


def test_whether_the_target_is_met() -> None:
    assert schedule().target_met(row(8, 0.0)) is None
    of = schedule(target_error=1e-3)
    assert of.target_met(None) is False
    assert of.target_met(row(8, 1e-3)) is True


def test_an_error_that_is_known_badly_takes_more_samples() -> None:
    """A few bright pixels: by chance below the target, and perhaps five times as large."""

    def seen(samples: float, high: float) -> ErrorRow:
        known = Estimate(0.009, 0.009**2 / high, high)
        return ErrorRow(samples, samples / 10, FrameError(known, known, np.ones(1), known), True)

    asked = schedule(target_error=0.01)
    assert asked.stop(8, seen(8, 0.01), 1.0) == Stop("target-error", True)
    assert asked.stop(8, seen(8, 0.045), 1.0) is None
    assert asked.expected_end(curve(seen(8, 0.045)), None) == 128
    assert asked.stop(64, seen(64, 0.045), 1.0) is None
    assert asked.stop(128, seen(128, 0.045), 1.0) == Stop("target-error", True)
    # Who asks for fewer has the estimate as it is.
    assert schedule(target_error=0.01, spp=8).target_met(seen(8, 0.045)) is True


def test_an_error_that_falls_as_1_over_samples_is_reached_at_a_multiple() -> None:
    of = schedule(target_error=1e-3, adaptive=False)
    measured = curve(row(8, 16e-3), row(16, 8e-3))
    assert measured.rate() == pytest.approx(1.0)
    assert of.expected_end(measured, None) == 128
    assert of.expected_end(curve(), None) is None
    assert schedule(spp=64).expected_end(measured, None) is None


def test_rows_that_do_not_decide_change_no_expectation() -> None:
    of, rows = schedule(target_error=1e-3, adaptive=False), (row(8, 16e-3), row(16, 8e-3))
    more = curve(*rows, row(20, 1.0, anchor=False))
    assert of.expected_end(more, None) == of.expected_end(curve(*rows), None)


def test_rates_are_of_two_anchors_and_within_reason() -> None:
    assert curve(row(8, 1.0)).rate() == USUAL_RATE
    assert curve(row(8, 1.0), row(16, 0.0)).rate() == USUAL_RATE
    assert curve(row(8, 1.0), row(16, 1e-9)).rate() == 2.0
    assert curve(row(8, 1.0), row(16, 9.0)).rate() == 0.5
    assert curve(row(8, 1.0), row(16, 0.5**0.5), metric=Metric.RMSE).rate() == pytest.approx(1.0)


def test_what_is_out_of_reach_is_expected_at_the_most_samples() -> None:
    assert schedule(target_error=1e-30, adaptive=False).expected_end(curve(row(8, 1.0)), None) == MAX_SPP


def test_how_much_is_done_is_told_by_the_first_rule_to_end_it() -> None:
    assert schedule(spp=100).fraction(25, None, 0.0) == 0.25
    assert schedule(sample_range=(10, 20)).fraction(15, None, 0.0) == 0.5
    assert schedule(spp=100, target_error=1.0).fraction(25, 50, 0.0) == 0.5
    assert schedule(spp=100, target_error=1.0).fraction(60, 50, 0.0) == 0.99
    assert schedule(spp=100, time_limit_s=4.0).fraction(25, None, 3.0) == 0.75


def test_a_curve_keeps_its_rows() -> None:
    first, second = row(8, 1.0), row(16, 0.5)
    both = curve(first).add(second)
    assert both.rows == (first, second)
    assert both.at(16) is second
    assert both.at(8) is None
    assert both.change_last(first).rows == (first, first)
    assert curve().last is None
