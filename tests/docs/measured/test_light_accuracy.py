"""The page of accuracy is what was measured last, and nothing in it is off."""

from __future__ import annotations

import json

from tests.docs.measured.light_accuracy import PAGE, RESULTS, page
from tests.reference.cases.table import cases


def test_the_page_is_fresh() -> None:
    kept = json.loads(RESULTS.read_text(encoding="utf-8"))
    assert PAGE.read_text(encoding="utf-8") == page(kept)


def test_what_is_measured_are_cases_and_none_is_off() -> None:
    kept = json.loads(RESULTS.read_text(encoding="utf-8"))["cases"]
    assert set(kept) <= {case.id for case in cases()}
    assert not {name: row["faults"] for name, row in kept.items() if row["faults"]}
