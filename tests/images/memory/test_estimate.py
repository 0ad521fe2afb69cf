"""The estimate of `primray inspect` is within a quarter of what renders of generated stages take at their peak."""

from __future__ import annotations

import pytest
from tests.bench.setup.memory import GENERATED, generated


@pytest.mark.long
def test_estimates() -> None:
    found = {row.name: row.estimated / row.measured for row in generated()}
    assert len(found) == len(GENERATED)
    assert {name: ratio for name, ratio in found.items() if not 0.75 < ratio < 1.25} == {}
