"""What a forecast says between measurements, of a render whose clock is told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from tests.images.checkpoints import resuming

from primray.sampling.error import Estimate
from primray.sampling.prediction import Forecaster
from primray.sampling.sampling import Sampling
from primray.settings import Metric


def paused(at: int, **values: Any) -> Sampling:
    """A render that has `at` samples a pixel and no more, as if each of them had taken a tenth of a second."""
    sampling = resuming.begin(**{**values, "spp": at, "target_error": None, "adaptive": False})
    assert sampling.run()
    sampling.stop = None
    sampling.schedule = replace(sampling.schedule, settings=resuming.settings(**values))
    sampling.seconds = sampling.now_s = at / 10
    return sampling


def look(sampling: Sampling, **options: Any) -> tuple[Estimate | None, Estimate | None]:
    forecaster = Forecaster(sampling, **options)
    forecaster.start_s = 0.0
    forecaster.marks.clear()
    forecaster.marks.append((0.0, 0.0))
    found = forecaster.look()
    return found.error, found.left_s


def test_before_anything_is_known() -> None:
    sampling = resuming.begin(spp=100)
    assert (Forecaster(sampling).look().error, Forecaster(sampling).look().left_s) == (None, None)


def test_where_it_was_measured_the_error_is_what_was_measured() -> None:
    sampling = paused(16, spp=64)
    assert look(sampling)[0] == sampling.rows[-1].error.relmse


@pytest.mark.parametrize("metric", Metric)
def test_from_there_the_error_falls_and_its_interval_widens(metric: Metric) -> None:
    sampling = paused(16, spp=64, error_metric=metric)
    early = look(sampling)[0]
    sampling.curve = replace(sampling.curve, rows=sampling.rows[:-1])
    late = look(sampling)[0]
    row = sampling.rows[-1].error.of(metric)
    assert early is not None
    assert late is not None
    assert late.value < row.value
    assert late.high / late.low > row.high / row.low
    assert late.low < early.value < late.high


def test_samples_end_it() -> None:
    _, left = look(paused(16, spp=64))
    assert left is not None
    assert left.value == pytest.approx(4.8)
    assert left.low < 4.8 < left.high


def test_what_comes_after_the_last_sample_counts() -> None:
    _, left = look(paused(16, spp=64), tail_s=2.0)
    assert left is not None
    assert left.value == pytest.approx(6.8)


def test_time_ends_it() -> None:
    sampling = paused(16, time_limit_s=4.0)
    _, left = look(sampling)
    assert left is not None
    assert (left.value, left.low, left.high) == pytest.approx((2.4, 2.4, 2.4))
    sampling.count_as_spent(3.0)
    _, left = look(sampling)
    assert left is not None
    assert left.value == pytest.approx(1.0)


def test_a_target_ends_it() -> None:
    """Two anchors say how fast the error falls; it is to fall to a quarter."""
    sampling = paused(16, adaptive=False, target_error=1.0)
    target = sampling.rows[-1].error.relmse.value / 4
    sampling.schedule = replace(sampling.schedule, settings=replace(sampling.settings, target_error=target))
    _, left = look(sampling)
    assert left is not None
    expected = 16 * 4 ** (1 / sampling.curve.rate())
    assert left.value == pytest.approx((expected - 16) / 10, abs=0.2)  # it ends at the end of a block
    assert left.low < left.value < left.high


def test_whatever_is_first() -> None:
    sampling = paused(16, spp=64, time_limit_s=3.0, target_error=1e-12, adaptive=False)
    _, left = look(sampling)
    assert left is not None
    assert left.value == pytest.approx(1.4)


def test_a_target_that_is_reached_takes_no_longer() -> None:
    sampling = paused(16, target_error=1e6, adaptive=False)
    _, left = look(sampling)
    assert left is not None
    assert left.value == 0.0
