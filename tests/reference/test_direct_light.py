"""Direct light of primray against the referee: a few samples in every run, the whole table by `make light-accuracy`."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.reference.cases import Case
from tests.reference.judge import judge
from tests.reference.record import record
from tests.reference.table import cases

SEEDS = 4
ROUGHLY = (6, 4)
REFEREE_BOUND = 3e-4  # a third of what the mean may be off


def _params(chosen: list[Case]) -> list[object]:
    return [pytest.param(c, id=c.id, marks=[pytest.mark.conforms(*c.rows)] if c.rows else []) for c in chosen]


@pytest.mark.parametrize("case", _params([c for c in cases() if c.quick]))
def test_direct_light_roughly(case: Case, tmp_path: Path) -> None:
    """Few, large pixels: the mean within its own error of the referee's, and every pixel."""
    found = judge(case.stage(tmp_path), case.plane, case.spp, SEEDS, ROUGHLY)
    assert not found.faults(tolerance=0.01)


@pytest.mark.long
@pytest.mark.parametrize("case", _params(cases()))
def test_direct_light(case: Case, tmp_path: Path) -> None:
    spp = case.spp * case.times
    found = judge(case.stage(tmp_path), case.plane, spp, SEEDS, case.resolution)
    record(case, found, spp, SEEDS)
    assert found.referee_error < REFEREE_BOUND
    assert not found.faults()
