"""The cross-half estimate is without bias, whatever the denoiser does; and sees what comparing two denoised halves does not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from primray.arrays import Doubles
from primray.denoising.denoised import Halves, cross_half_error
from primray.sampling.error import student_quantile

SIZE, RUNS = (24, 32), 200


def _truth() -> Doubles:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    made: Doubles = np.stack([0.5 + 0.4 * np.sin(x / 4), 0.3 + 0.02 * y, np.where((x // 8 + y // 8) % 2, 1.0, 0.1)], axis=2)
    return made


def _mean_of_neighbours(values: Doubles) -> Doubles:
    made: Doubles = np.mean([np.roll(values, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
    return made


DENOISERS: dict[str, Callable[[Doubles], Doubles]] = {
    "blur": _mean_of_neighbours,
    "black": lambda values: np.zeros_like(values),
    "none": lambda values: values,
    "shift": lambda values: np.roll(values, 2, 1) * 1.1,
}


def _run(name: str, random: np.random.Generator) -> tuple[float, float, bool, float]:
    """Estimated and true mean square, whether the interval holds it, and what the two denoised halves' difference says."""
    truth, noise = _truth(), 0.3
    a, b = (truth * random.gamma(1 / noise, noise, truth.shape) for _ in range(2))
    p, q = DENOISERS[name](a), DENOISERS[name](b)
    found = cross_half_error(Halves(a, b, np.full((*SIZE, 1), 0.5), True), (p, q)).rmse
    true = float((((p + q) / 2 - truth) ** 2).mean())
    return found.value**2, true, found.low**2 <= true <= found.high**2, float(((p - q) ** 2).mean() / 4)


@pytest.mark.parametrize("name", DENOISERS)
def test_the_estimate_is_the_true_error_on_average(name: str) -> None:
    random = np.random.default_rng(5)
    runs = [_run(name, random) for _ in range(RUNS)]
    estimates, truths = np.array([run[0] for run in runs]), np.array([run[1] for run in runs])
    deviation = (estimates - truths).std() / RUNS**0.5
    assert abs((estimates - truths).mean()) < 4 * deviation
    assert deviation < 0.05 * truths.mean()  # the test could tell
    assert np.mean([run[2] for run in runs]) > 0.93


def test_what_both_halves_have_lost_is_seen() -> None:
    """A denoiser that answers black: its halves agree, and are wrong."""
    estimate, true, _, difference = _run("black", np.random.default_rng(6))
    assert difference == 0
    assert estimate == pytest.approx(true, rel=0.1)


def test_estimates_below_0_are_0_with_an_interval_above() -> None:
    truth = np.full((*SIZE, 3), 0.5)
    random = np.random.default_rng(7)
    a, b = (truth + random.normal(0, 0.1, truth.shape) for _ in range(2))
    found = cross_half_error(Halves(a, b, np.full((*SIZE, 1), 0.5), True), (truth, truth))
    assert found.relmse.low == 0
    assert found.relmse.high > 0
    assert found.as_json()["rmse"]["ci95"][0] == 0


def test_an_estimate_far_below_0_leaves_doubt() -> None:
    """One half is above the denoised picture everywhere, the other below: the estimate is negative by more than its step."""
    truth = np.full((*SIZE, 3), 0.5)
    found = cross_half_error(Halves(truth + 0.1, truth - 0.1, np.full((*SIZE, 1), 0.5), True), (truth, truth))
    assert found.relmse.value == found.relmse.low == 0
    assert found.relmse.high == pytest.approx(0.01 / 0.26)
    assert found.rmse.high == pytest.approx(0.1)


@pytest.mark.parametrize(("freedom", "quantile"), [(3, 3.182), (5, 2.571), (10, 2.228), (30, 2.042), (1e9, 1.960)])
def test_the_quantile_is_students(freedom: float, quantile: float) -> None:
    assert student_quantile(freedom) == pytest.approx(quantile, rel=0.02)


def test_an_error_of_few_tiles_is_known_less_well() -> None:
    """Of the same sum of squares by tile: spread over all of them, or held by two."""
    flat = np.full((32, 32, 3), 0.5)

    def width(error: Doubles) -> float:
        halves = Halves(flat + error, flat + error, np.full((32, 32, 1), 0.5), True)
        rmse = cross_half_error(halves, (flat, flat)).rmse
        return float(rmse.high**2 - rmse.value**2)

    spread = np.full((32, 32, 3), 0.1)
    few = np.zeros((32, 32, 3))
    few[:4, :8] = 0.1 * 32**0.25  # two tiles, each with the square of 32 in the sum of squares by tile
    assert width(few) > 1.8 * width(spread)
