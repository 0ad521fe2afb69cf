"""Each record of docs/decisions has all of its fields, points to records that are there, and is in the index."""

from __future__ import annotations

from dataclasses import replace

import pytest

from .decisions import FOLDER, INDEX, faults, index, read, records

GOOD = """# A title

- Date: 2026-11-22
- Status: current

## Choice

This.

## Why

Because.

## Rejected

- That: it is slower.
"""
LATER = read("lights/later.md", GOOD.replace("11-22", "11-23").replace("A title", "Later"))


def test_the_records_have_no_fault():
    found = records()
    assert len(found) >= 124
    assert not list(faults(found))


def test_the_index_is_fresh():
    assert INDEX.read_text(encoding="utf-8") == index(records()), f"{INDEX} is stale; run `make docs`"


def test_no_record_lies_elsewhere():
    assert {path.name for path in FOLDER.glob("*.md")} == {"README.md", "tried.md"}
    assert not list(FOLDER.glob("*/*/*"))


@pytest.mark.parametrize("status", ["current", "amended by [Later](later.md)", "superseded by [Later](../lights/later.md)"])
def test_a_good_record_has_no_fault(status):
    record = read("lights/a.md", GOOD.replace("Status: current", f"Status: {status}"))
    assert not list(faults([record, LATER]))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("# A title", "A title", "title"),
        ("- Date: 2026-11-22\n", "", "no date"),
        ("2026-11-22", "2026-13-22", "no date"),
        ("- Status: current\n", "", "no status"),
        ("Status: current", "Status: old", "no status"),
        ("Status: current", "Status: superseded by later.md", "no status"),
        ("Status: current", "Status: superseded by [Later](gone.md)", "is no record"),
        ("Status: current", "Status: superseded by [Sooner](later.md)", "it is called 'Later'"),
        ("Status: current", "Status: amended by [A title](a.md)", "not later"),
        ("Because.", "", "'Why'"),
        ("## Rejected\n\n- That: it is slower.\n", "", "'Rejected'"),
        ("## Why", "## Reasons", "'Reasons'"),
    ],
)
def test_each_rule_can_fail(old, new, why):
    assert old in GOOD
    found = list(faults([read("lights/a.md", GOOD.replace(old, new)), LATER]))
    assert any(why in fault for fault in found), found


def test_a_record_does_not_name_an_earlier_one():
    record = read("lights/a.md", GOOD.replace("Status: current", "Status: amended by [Later](later.md)"))
    assert any("not later" in fault for fault in faults([record, replace(LATER, date="2026-11-21")]))


def test_topics_are_listed():
    assert any("no topic" in fault for fault in faults([replace(LATER, path="other/a.md")]))
