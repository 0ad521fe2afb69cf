"""docs/fidelity.md has every code, each with its kind and what to do about it."""

from __future__ import annotations

import re

from primray.diagnostics import CODES, Severity
from primray.fidelity import FIDELITY, Kind

from .fidelity import KINDS, PAGE, page


def test_the_page_is_fresh():
    assert PAGE.read_text(encoding="utf-8") == page(), "docs/fidelity.md is stale; run `make docs`"


def test_each_code_has_a_kind_and_advice():
    assert set(FIDELITY) == set(CODES)
    assert set(KINDS) == set(Kind)
    for row in FIDELITY.values():
        assert row.advice.endswith(".")


def test_each_code_has_an_anchor_of_its_own():
    headings = re.findall(r"^###? (.+)$", page(), re.MULTILINE)
    assert len(set(headings)) == len(headings)
    assert set(CODES) <= set(headings)


def test_an_error_is_about_what_is_missing():
    assert {FIDELITY[code].kind for code, row in CODES.items() if row.severity is Severity.ERROR} == {Kind.MISSING}
