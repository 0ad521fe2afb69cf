"""Direct light of primray against the referee: a few samples in every run, the whole table by `make light-accuracy`."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.reference.cases.plane_cases import Case
from tests.reference.cases.table import cases
from tests.reference.judging.judge import judge
from tests.reference.judging.kept import kept_or_made, key_of, pictures
from tests.reference.judging.record import record
from tests.reference.referee import expected

SEEDS = 4
ROUGHLY = (6, 4)
REFEREE_BOUND = 3e-4  # a third of what the mean may be off


def _params(chosen: list[Case]) -> list[object]:
    return [pytest.param(c, id=c.id, marks=[pytest.mark.conforms(*c.rows)] if c.rows else []) for c in chosen]


@pytest.mark.parametrize("case", _params([c for c in cases() if c.quick]))
def test_direct_light_roughly(case: Case, tmp_path: Path) -> None:
    """Few, large pixels: the mean within its own error of the referee's, and every pixel."""
    stage = case.stage(tmp_path)
    found = judge(stage, kept_or_made(case, stage, ROUGHLY), case.spp, SEEDS)
    assert not found.faults(tolerance=0.01)


def test_pictures_that_are_kept_are_of_these_cases_and_this_referee() -> None:
    known = {case.id: key_of(case, ROUGHLY) for case in cases()}
    stale = [name for name, kept in pictures().items() if known.get(name) != kept["key"]]
    assert not stale, "PRIMRAY_UPDATE=1 python -m pytest tests/reference"


@pytest.mark.long
@pytest.mark.parametrize("case", _params(cases()))
def test_direct_light(case: Case, tmp_path: Path) -> None:
    spp = case.spp * case.times
    stage = case.stage(tmp_path)
    found = judge(stage, expected(stage, case.plane, case.resolution), spp, SEEDS)
    record(case, found, spp, SEEDS)
    assert found.referee_error < REFEREE_BOUND
    assert not found.faults()
