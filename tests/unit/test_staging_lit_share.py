"""The lit share of a test render decides whether a stage gets the studio light."""

from __future__ import annotations

import numpy as np
import pytest

from primray.staging import BLOCK, DARK_RADIANCE, lit_share


def test_shares_are_of_the_coverage() -> None:
    pixels = np.zeros((2 * BLOCK, 4 * BLOCK, 4), np.float32)
    assert lit_share(pixels) is None
    pixels[:, : 3 * BLOCK, 3] = 1
    pixels[:BLOCK, :BLOCK, 2] = DARK_RADIANCE * 1.01
    pixels[BLOCK:, BLOCK : 2 * BLOCK, :3] = DARK_RADIANCE * 0.99
    assert lit_share(pixels) == pytest.approx(1 / 6)
