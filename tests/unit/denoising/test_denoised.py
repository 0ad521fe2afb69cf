"""A denoised picture that is worse than the picture it was made of says so."""

from __future__ import annotations

from typing import Any

import pytest

from primray.denoising.denoised import worse_than_record


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
