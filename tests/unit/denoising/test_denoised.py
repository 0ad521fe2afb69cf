"""The denoised picture's error: its estimate where samples are rare and bright; a picture that is worse than its record."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from primray.arrays import Doubles
from primray.denoising.denoised import DARKEST, Halves, cross_half_error, worse_than_record


def error(estimate: float, low: float, high: float) -> dict[str, Any]:
    return {"relmse": {"estimate": estimate, "ci95": [low, high]}}


@pytest.mark.parametrize(
    ("denoised", "record", "is_worse"),
    [
        (error(4e-4, 3e-4, 5e-4), error(1e-4, 9e-5, 2e-4), True),
        (error(4e-4, 0.5e-4, 9e-4), error(1e-4, 9e-5, 2e-4), False),  # too uncertain to tell
        (error(1e-4, 9e-5, 2e-4), error(4e-4, 3e-4, 5e-4), False),
        (None, error(4e-4, 3e-4, 5e-4), False),
        (error(4e-4, 3e-4, 5e-4), {"relmse": None}, False),
    ],
)
def test_only_what_is_surely_worse_is_reported(denoised: Any, record: Any, is_worse: bool) -> None:
    said = worse_than_record({"denoised": {"error": denoised}, "error": record})
    assert (said is not None) is is_worse
    assert said is None or "--denoise" in said


def smoothed(values: Doubles) -> Doubles:
    """Means over 5 x 5 pixels, which stands in for a denoiser."""
    for axis in (0, 1):
        values = sum((np.roll(values, k, axis) for k in range(-2, 3)), np.zeros_like(values)) / 5
    return values


@pytest.mark.parametrize("samples", [16, 32, 128])
def test_rare_bright_samples_do_not_hide_the_error(samples: int) -> None:
    """A grey picture, 30 % of which comes from one sample in 333."""
    random = np.random.default_rng(samples)
    truth, level, rare = 0.0, 0.3, 0.003
    told = 0.0

    def half() -> Doubles:
        specks = random.poisson(rare * samples, (96, 96, 1)) / samples * (level * 0.3 / rare)
        return level * 0.7 * (1 + random.normal(0, 0.5, (96, 96, 3)) / np.sqrt(samples)) + specks

    for _ in range(8):
        halves = Halves(half(), half(), np.full((96, 96, 1), 0.5), True)
        denoised = smoothed(halves.a), smoothed(halves.b)
        truth += float(((((denoised[0] + denoised[1]) / 2 - level) ** 2) / (level**2 + DARKEST)).mean()) / 8
        told += cross_half_error(halves, denoised).relmse.value / 8
    assert 0.6 < told / truth < 1.7  # 0 to 0.4 where negative squares did not count
