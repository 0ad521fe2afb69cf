"""docs/fidelity.md has every code, each with its kind and what to do about it."""

from __future__ import annotations

import json
import re
from pathlib import Path

from primray.diagnostic_codes import CODES, Kind, Severity

from .fidelity import KINDS, PAGE, page


def test_the_page_is_fresh():
    assert PAGE.read_text(encoding="utf-8") == page(), "docs/fidelity.md is stale; run `make docs`"


def test_each_code_has_a_kind_and_advice():
    assert set(KINDS) == set(Kind)
    for row in CODES.values():
        assert row.advice.endswith(".")


def test_each_code_has_an_anchor_of_its_own():
    headings = re.findall(r"^###? (.+)$", page(), re.MULTILINE)
    assert len(set(headings)) == len(headings)
    assert set(CODES) <= set(headings)


def test_the_service_names_the_same_kinds():
    schemas = Path(__file__).parents[3] / "schemas"
    warning = json.loads((schemas / "openapi.json").read_text())["components"]["schemas"]["Warning"]
    [kinds] = [set(each["enum"]) for each in warning["properties"]["kind"]["anyOf"] if "enum" in each]
    [severities] = [set(each["enum"]) for each in warning["properties"]["severity"]["anyOf"] if "enum" in each]
    assert kinds == {kind.value for kind in Kind}
    assert severities == {severity.value for severity in Severity}
    assert "attribute" in warning["properties"]
    for name in ("job", "scene"):
        assert "Warning" in json.loads((schemas / f"{name}.schema.json").read_text())["$defs"]


def test_an_error_is_about_what_is_missing():
    assert {row.kind for row in CODES.values() if row.severity is Severity.ERROR} == {Kind.MISSING}
